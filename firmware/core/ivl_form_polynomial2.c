/// @file ivl_form_polynomial2.c
/// For every approach: the threshold of RREV is a polynomial of the second degree in the sensed velocities.
#include "ivl_general.h"

static const ivl_form_group_t GROUPS[] = {
    IVL_GENERAL_POLYNOMIAL(6, "r_0_per_s r_x_per_s r_z_per_s r_xx_per_s r_xz_per_s r_zz_per_s", "R_0 R_x R_z R_xx R_xz R_zz"),
    IVL_GENERAL_GROUPS,
};

static float threshold_per_s(const float c[], const ivl_point_t *p)
{
    return ivl_general_poly2(c, p->x, p->z);
}

IVL_GENERAL_FORM(polynomial2, 6, "for every approach: threshold of RREV of the second degree in the sensed velocities, moment, go / no-go");
