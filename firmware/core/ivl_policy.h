/// @file ivl_policy.h
/// The learned parameters: check and commit, and what they decide.
#ifndef IVL_POLICY_H
#define IVL_POLICY_H
#include "ivl_form.h"

/// Which policy it is, in a few bytes.
typedef struct
{
    uint32_t seq;   ///< number given by the sender
    uint32_t crc;   ///< of form and parameters: see ivl_policy_crc
    uint8_t  form;  ///< row of IVL_FORMS
} ivl_policy_id_t;

/// `at_once` is for studies of the flip alone, in the simulator: no packet of the radio carries it, so no policy that a host sends has it.
typedef struct
{
    ivl_policy_id_t id;
    uint8_t         n;        ///< parameters of the form
    bool            at_once;  ///< flip at the first valid cue, whatever the form says of when and of go / no-go; see below
    float           theta[IVL_FORM_PARAMS_MAX];  ///< SI; those beyond n are 0
} ivl_policy_t;

/// CRC-32 of what a policy says: the name of its form, and its parameters as little-endian floats.  Two programs whose forms differ disagree.
/// @return 0 if there is no such form, or n is not its number of parameters
uint32_t ivl_policy_crc(const ivl_policy_t *policy);

/// Good if the form exists, each parameter is in its range (NaN is not), and the moment that it can ask for is within cfg->flip_moment_Nm_max.
/// @return IVL_OK, IVL_ERR_FORM or IVL_ERR_RANGE
ivl_status_t ivl_policy_check(const ivl_cfg_t *cfg, const ivl_policy_t *policy);

/// What a policy decides from what is seen.  Without a valid cue, or while the ceiling does not come closer, it decides nothing: no flip.
/// A flip that is not to go is left to the rule no_go, which calls the approach off.
ivl_action_t ivl_policy_decide(const ivl_policy_t *policy, const ivl_seen_t *seen);
#endif  // IVL_POLICY_H
