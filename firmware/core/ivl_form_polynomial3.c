/// @file ivl_form_polynomial3.c
/// For every approach: the threshold of RREV is a polynomial of the third degree in the sensed velocities.
#include "ivl_general.h"

enum
{
    THRESHOLD,
    REST = 10,
    N_PARAMS = REST + IVL_GENERAL_N
};

static const ivl_form_group_t GROUPS[] = {
    {REST, -40.0f, 40.0f,
     IVL_FORM_TEXT(1.0f, "1/s",
                   "r_0_per_s r_x_per_s r_z_per_s r_xx_per_s r_xz_per_s r_zz_per_s r_xxx_per_s r_xxz_per_s r_xzz_per_s r_zzz_per_s",
                   "R_0 R_x R_z R_xx R_xz R_zz R_xxx R_xxz R_xzz R_zzz",
                   "threshold of RREV, 0.5 to 20 1/s: coefficients of 1, x = (v_x - 1.4 m/s) / (2 m/s), z = (v_z - 1.6 m/s) / (2 m/s) "
                   "and their products")},
    IVL_GENERAL_GROUPS,
};

static ivl_action_t decide(const float theta[], const ivl_seen_t *seen)
{
    const ivl_point_t p = ivl_general_point(seen);
    return ivl_general_action(theta + REST, seen, p.x, p.z, ivl_general_poly3(theta + THRESHOLD, p.x, p.z));
}

static float moment_most_Nm(const float theta[])
{
    return ivl_general_moment_most_Nm(theta + REST);
}

const ivl_form_t ivl_form_polynomial3 = {
    .name = "polynomial3",
    IVL_FORM_DOC("for every approach: threshold of RREV of the third degree in the sensed velocities, moment, go / no-go").groups = GROUPS,
    .n_groups = 1 + IVL_GENERAL_N_GROUPS,
    .n_params = N_PARAMS,
    .decide = decide,
    .moment_most_Nm = moment_most_Nm,
};
