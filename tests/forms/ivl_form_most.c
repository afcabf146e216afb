/// @file ivl_form_most.c
/// As many parameters as a form may have: a mean of thresholds, one moment.
#include "ivl_form.h"

#define THRESHOLD(i) {"threshold" #i "_per_s", "R_" #i, "1/s", 1.0f, 0.0f, 20.0f, "one of the thresholds"}
#define EIGHT(i)                                                                                                                           \
    THRESHOLD(i##0), THRESHOLD(i##1), THRESHOLD(i##2), THRESHOLD(i##3), THRESHOLD(i##4), THRESHOLD(i##5), THRESHOLD(i##6), THRESHOLD(i##7)

enum
{
    MOMENT = IVL_FORM_PARAMS_MAX - 1
};

static const ivl_form_param_t PARAMS[] = {
    EIGHT(0),      EIGHT(1),      EIGHT(2),      EIGHT(3),      EIGHT(4),
    EIGHT(5),      EIGHT(6),      THRESHOLD(70), THRESHOLD(71), THRESHOLD(72),
    THRESHOLD(73), THRESHOLD(74), THRESHOLD(75), THRESHOLD(76), {"flip_Nmm", "M", "N mm", 1.0e-3f, 0.0f, 0.02f, "moment"},
};
_Static_assert(sizeof PARAMS / sizeof PARAMS[0] == IVL_FORM_PARAMS_MAX, "all of them");

static ivl_action_t decide(const float theta[], const ivl_seen_t *seen)
{
    float sum = 0.0f;
    for (int i = 0; i < (int)MOMENT; i++)
    {
        sum += theta[i];
    }
    return (ivl_action_t){.flip = seen->cues.rrev_per_s >= sum / (float)MOMENT, .go = true, .moment_Nm = theta[MOMENT]};
}

static float moment_most_Nm(const float theta[])
{
    return theta[MOMENT];
}

const ivl_form_t ivl_form_most = {.name = "most",
                                  .doc = "a mean of thresholds, one moment",
                                  .params = PARAMS,
                                  .n_params = IVL_FORM_PARAMS_MAX,
                                  .decide = decide,
                                  .moment_most_Nm = moment_most_Nm};
