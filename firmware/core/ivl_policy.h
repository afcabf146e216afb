/// @file ivl_policy.h
/// The learned parameters: range check and commit.
#ifndef IVL_POLICY_H
#define IVL_POLICY_H
#include "ivl_state.h"

/// Check a policy and put it in force as a whole, or refuse it as a whole (counted in diag.n_policy_refused).
/// Ranges: rrev_c_per_s in [0, cfg->rrev_c_per_s_max], moment_y_Nm in [0, cfg->moment_y_Nm_max]; NaN is refused.
/// @return IVL_OK; IVL_ERR_RANGE; IVL_ERR_PHASE after the trigger, until the phase is IDLE again
ivl_status_t ivl_policy_commit(const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_policy_t *policy);
#endif  // IVL_POLICY_H
