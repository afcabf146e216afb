/// @file ivl_form_constant.c
/// The paper's policy: a threshold of RREV and a moment, both constant over an approach [P].
#include "ivl_form.h"

enum
{
    RREV_C,
    MOMENT,
    N_PARAMS
};

static const ivl_form_param_t PARAMS[] = {
    [RREV_C] = {"rrev_c_per_s", "RREV_c", "1/s", 1.0f, 0.0f, 20.0f,
                "RREV at which the flip starts; 0: the first tick that sees the ceiling close"},
    [MOMENT] = {"moment_y_Nmm", "M_yd", "N mm", 1.0e-3f, 0.0f, 0.02f, "nose-up moment of the front motors"},
};
_Static_assert(sizeof PARAMS / sizeof PARAMS[0] == N_PARAMS, "one row a parameter");

static ivl_action_t decide(const float theta[], const ivl_seen_t *seen)
{
    return (ivl_action_t){.flip = seen->cues.rrev_per_s >= theta[RREV_C], .go = true, .moment_Nm = theta[MOMENT]};
}

static float moment_most_Nm(const float theta[])
{
    return theta[MOMENT];
}

const ivl_form_t ivl_form_constant = {
    .name = "constant",
    .doc = "a threshold of RREV and a moment, both constant over an approach",
    .params = PARAMS,
    .n_params = N_PARAMS,
    .decide = decide,
    .moment_most_Nm = moment_most_Nm,
};
