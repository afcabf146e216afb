/// @file ivl_general.h
/// What the forms for every approach share: the sensed velocities, and from them the moment and the probability of a landing.
/// They compare RREV with a threshold that depends on the velocities: a scale error of the distance then cancels nearly.
#ifndef IVL_GENERAL_H
#define IVL_GENERAL_H
#include "ivl_form.h"

/// The sensed velocities (closing v_z = RREV d, along the ceiling v_x = -OF_y d), limited to 0..5 m/s: forms know nothing beyond.
/// x and z are the same as coordinates without a unit, about 0 in the middle of the approaches that are flown:
/// x = (v_x - 1.4 m/s) / (2 m/s), z = (v_z - 1.6 m/s) / (2 m/s).
typedef struct
{
    float vx_mps, vz_mps, x, z;
} ivl_point_t;

#define IVL_GENERAL_V_MPS_MAX 5.0f

ivl_point_t ivl_general_point(const ivl_seen_t *seen);

/// Polynomial of the second degree, 6 coefficients: 1, x, z, xx, xz, zz.
float ivl_general_poly2(const float c[], float x, float z);

/// Polynomial of the third degree, 10 coefficients: those of poly2, then xxx, xxz, xzz, zzz.
float ivl_general_poly3(const float c[], float x, float z);

// ---- the second half of each form's parameters

#define IVL_GENERAL_N_MOMENT 3
#define IVL_GENERAL_N_GO     11
#define IVL_GENERAL_N        (IVL_GENERAL_N_MOMENT + IVL_GENERAL_N_GO)

// clang-format off
/// Groups of those parameters: moment, threshold of the probability, its logistic polynomial.
#define IVL_GENERAL_GROUPS                                                                                                                   \
    {IVL_GENERAL_N_MOMENT, -0.02f, 0.02f, IVL_FORM_TEXT(1.0e-3f, "N mm", "m_0_Nmm m_x_Nmm m_z_Nmm", "M_0 M_x M_z",                           \
        "moment of the flip: M_0 + M_x x + M_z z, not below 0")},                                                                            \
    {1, 0.0f, 1.0f, IVL_FORM_TEXT(1.0f, "1", "go_p_min", "P_min", "go / no-go: no flip where a landing is less probable; 0: always go")},    \
    {IVL_GENERAL_N_GO - 1, -200.0f, 200.0f, IVL_FORM_TEXT(1.0f, "1",                                                                         \
        "go_0 go_x go_z go_xx go_xz go_zz go_xxx go_xxz go_xzz go_zzz", "G_0 G_x G_z G_xx G_xz G_zz G_xxx G_xxz G_xzz G_zzz",                \
        "go / no-go: log-odds of a landing, coefficients of 1, x, z and their products")}
// clang-format on
#define IVL_GENERAL_N_GROUPS 3

/// The action of a form whose threshold is known.
/// @param[in] rest  the IVL_GENERAL_N parameters behind those of the threshold
ivl_action_t ivl_general_action(const float rest[], const ivl_seen_t *seen, float x, float z, float threshold_per_s);

/// Largest moment of any p: the moment is linear, so it is that of a corner.
float ivl_general_moment_most_Nm(const float rest[]);
#endif  // IVL_GENERAL_H
