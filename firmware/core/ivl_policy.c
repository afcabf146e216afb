/// @file ivl_policy.c
#include "ivl_policy.h"

static bool in_range(const ivl_cfg_t *cfg, const ivl_policy_t *policy)
{
    return (policy->rrev_c_per_s >= 0.0f) && (policy->rrev_c_per_s <= cfg->rrev_c_per_s_max) && (policy->moment_y_Nm >= 0.0f) &&
           (policy->moment_y_Nm <= cfg->moment_y_Nm_max);
}

ivl_status_t ivl_policy_commit(const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_policy_t *policy)
{
    const bool   open = !state->triggered || (state->phase == IVL_PHASE_IDLE);
    ivl_status_t status = in_range(cfg, policy) ? IVL_OK : IVL_ERR_RANGE;
    status = open ? status : IVL_ERR_PHASE;
    if (status == IVL_OK)
    {
        state->policy = *policy;
        state->has_policy = true;
    }
    else
    {
        state->diag.n_policy_refused++;
    }
    return status;
}
