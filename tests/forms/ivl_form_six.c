/// @file ivl_form_six.c
/// A form of six parameters: threshold and moment are linear in the velocities that the cues tell, and limited.
#include "ivl_form.h"
#include "ivl_math.h"

enum
{
    RREV_0,
    RREV_VZ,
    RREV_VX,
    MOMENT_0,
    MOMENT_VZ,
    MOMENT_MOST,
    N_PARAMS
};

static const ivl_form_group_t GROUPS[] = {
    [RREV_0] = {1, 0.0f, 20.0f, IVL_FORM_TEXT(1.0f, "1/s", "threshold_per_s", "R_0", "threshold of RREV at rest")},
    [RREV_VZ] = {1, -4.0f, 4.0f, IVL_FORM_TEXT(1.0f, "1/m", "threshold_vz_per_m", "R_z", "its change with the closing speed")},
    [RREV_VX] = {1, -4.0f, 4.0f, IVL_FORM_TEXT(1.0f, "1/m", "threshold_vx_per_m", "R_x", "its change with the speed along the ceiling")},
    [MOMENT_0] = {1, 0.0f, 0.02f, IVL_FORM_TEXT(1.0e-3f, "N mm", "flip_Nmm", "M_0", "moment at rest")},
    [MOMENT_VZ] = {1, -0.005f, 0.005f, IVL_FORM_TEXT(1.0e-3f, "mN s", "flip_vz_mNs", "M_z", "its change with the closing speed")},
    [MOMENT_MOST] = {1, 0.0f, 0.02f, IVL_FORM_TEXT(1.0e-3f, "N mm", "flip_most_Nmm", "M_most", "largest moment")},
};

static ivl_action_t decide(const float theta[], const ivl_seen_t *seen)
{
    const float d = seen->ceiling.d_ceil_m, vz = seen->cues.rrev_per_s * d, vx = -seen->cues.of_y_radps * d;
    const float threshold = theta[RREV_0] + theta[RREV_VZ] * vz + theta[RREV_VX] * vx;
    const float moment = theta[MOMENT_0] + theta[MOMENT_VZ] * vz;
    return (ivl_action_t){
        .flip = seen->cues.rrev_per_s >= threshold,
        .go = vz < 50.0f,
        .moment_Nm = ivl_clamp(moment, 0.0f, theta[MOMENT_MOST]),
        .p_land = 1.0f,
    };
}

static float moment_most_Nm(const float theta[])
{
    return theta[MOMENT_MOST];
}

const ivl_form_t ivl_form_six = {.name = "six",
                                 IVL_FORM_DOC("threshold and moment linear in the sensed velocities").groups = GROUPS,
                                 .n_groups = N_PARAMS,
                                 .n_params = N_PARAMS,
                                 .decide = decide,
                                 .moment_most_Nm = moment_most_Nm};
