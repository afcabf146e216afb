/// @file ivl_policy.c
#include "ivl_policy.h"

#include "ivl_math.h"
#include "ivl_wire.h"

static const ivl_form_t *form_of(const ivl_policy_t *policy)
{
    const ivl_form_t *form = ivl_form(policy->id.form);
    return ((form != NULL) && (policy->n == form->n_params)) ? form : NULL;
}

uint32_t ivl_policy_crc(const ivl_policy_t *policy)
{
    const ivl_form_t *form = form_of(policy);
    if (form == NULL)
    {
        return 0u;
    }
    uint32_t crc = 0u;
    for (const char *at = form->name; *at != '\0'; at++)
    {
        crc = ivl_wire_crc(crc, at, 1u);
    }
    for (uint32_t i = 0; i < policy->n; i++)
    {
        uint8_t bytes[4];
        ivl_wire_put_f32(bytes, policy->theta[i]);
        crc = ivl_wire_crc(crc, bytes, sizeof bytes);
    }
    return crc;
}

ivl_status_t ivl_policy_check(const ivl_cfg_t *cfg, const ivl_policy_t *policy)
{
    const ivl_form_t *form = form_of(policy);
    if (form == NULL)
    {
        return IVL_ERR_FORM;
    }
    bool         good = true;
    const float *theta = policy->theta, *end = theta + policy->n;
    for (uint32_t g = 0; g < form->n_groups; g++)
    {
        for (uint32_t i = 0; (i < form->groups[g].n) && (theta < end); i++, theta++)
        {
            // positive form, so that NaN is refused
            good = good && (*theta >= form->groups[g].lo) && (*theta <= form->groups[g].hi);
        }
    }
    // groups that do not reach the last parameter leave some unchecked
    good = good && (theta == end);
    return (good && (form->moment_most_Nm(policy->theta) <= cfg->flip_moment_Nm_max)) ? IVL_OK : IVL_ERR_RANGE;
}

ivl_action_t ivl_policy_decide(const ivl_policy_t *policy, const ivl_seen_t *seen)
{
    ivl_action_t      action = {.flip = false};
    const ivl_form_t *form = ivl_form(policy->id.form);
    if ((form != NULL) && seen->cues.valid && (seen->cues.rrev_per_s > 0.0f))
    {
        action = form->decide(policy->theta, seen);
        action.flip = action.flip || policy->at_once;
        action.go = action.go || policy->at_once;
    }
    return action;
}
