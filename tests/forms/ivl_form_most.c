/// @file ivl_form_most.c
/// As many parameters as a form may have: a mean of thresholds, one moment.
#include "ivl_form.h"

#define NAMES(i)                                                                                                                           \
    "threshold" #i "0_per_s threshold" #i "1_per_s threshold" #i "2_per_s threshold" #i "3_per_s threshold" #i "4_per_s threshold" #i      \
    "5_per_s threshold" #i "6_per_s threshold" #i "7_per_s threshold" #i "8_per_s"
#define SYMBOLS(i) "R_" #i "0 R_" #i "1 R_" #i "2 R_" #i "3 R_" #i "4 R_" #i "5 R_" #i "6 R_" #i "7 R_" #i "8"

enum
{
    MOMENT = IVL_FORM_PARAMS_MAX - 1
};

static const ivl_form_group_t GROUPS[] = {
    {MOMENT, 0.0f, 20.0f,
     IVL_FORM_TEXT(1.0f, "1/s", NAMES(0) " " NAMES(1) " " NAMES(2) " " NAMES(3) " " NAMES(4) " " NAMES(5) " " NAMES(6),
                   SYMBOLS(0) " " SYMBOLS(1) " " SYMBOLS(2) " " SYMBOLS(3) " " SYMBOLS(4) " " SYMBOLS(5) " " SYMBOLS(6),
                   "one of the thresholds")},
    {1, 0.0f, 0.02f, IVL_FORM_TEXT(1.0e-3f, "N mm", "flip_Nmm", "M", "moment")},
};
_Static_assert(MOMENT == 7 * 9, "as many as there are names");

static ivl_action_t decide(const float theta[], const ivl_seen_t *seen)
{
    float sum = 0.0f;
    for (int i = 0; i < (int)MOMENT; i++)
    {
        sum += theta[i];
    }
    return (ivl_action_t){.flip = seen->cues.rrev_per_s >= sum / (float)MOMENT, .go = true, .moment_Nm = theta[MOMENT], .p_land = 1.0f};
}

static float moment_most_Nm(const float theta[])
{
    return theta[MOMENT];
}

const ivl_form_t ivl_form_most = {.name = "most",
                                  IVL_FORM_DOC("a mean of thresholds, one moment").groups = GROUPS,
                                  .n_groups = sizeof GROUPS / sizeof GROUPS[0],
                                  .n_params = IVL_FORM_PARAMS_MAX,
                                  .decide = decide,
                                  .moment_most_Nm = moment_most_Nm};
