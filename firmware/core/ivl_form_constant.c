/// @file ivl_form_constant.c
/// The paper's policy: a threshold of RREV and a moment, both constant over an approach [P].
#include "ivl_form.h"

enum
{
    RREV_C,
    MOMENT,
    N_PARAMS
};

static const ivl_form_group_t GROUPS[] = {
    [RREV_C] = {1, 0.0f, 20.0f,
                IVL_FORM_TEXT(1.0f, "1/s", "rrev_c_per_s", "RREV_c",
                              "RREV at which the flip starts; 0: the first tick that sees the ceiling close")},
    [MOMENT] = {1, 0.0f, 0.02f, IVL_FORM_TEXT(1.0e-3f, "N mm", "moment_y_Nmm", "M_yd", "nose-up moment of the front motors")},
};
_Static_assert(sizeof GROUPS / sizeof GROUPS[0] == N_PARAMS, "one row a parameter");

static ivl_action_t decide(const float theta[], const ivl_seen_t *seen)
{
    return (ivl_action_t){.flip = seen->cues.rrev_per_s >= theta[RREV_C], .go = true, .moment_Nm = theta[MOMENT], .p_land = 1.0f};
}

static float moment_most_Nm(const float theta[])
{
    return theta[MOMENT];
}

const ivl_form_t ivl_form_constant = {
    .name = "constant",
    IVL_FORM_DOC("a threshold of RREV and a moment, both constant over an approach").groups = GROUPS,
    .n_groups = N_PARAMS,
    .n_params = N_PARAMS,
    .decide = decide,
    .moment_most_Nm = moment_most_Nm,
};
