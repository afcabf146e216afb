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

// clang-format off
/// Group of a polynomial's parameters, the threshold in 1/s.
#define IVL_GENERAL_POLYNOMIAL(n_, names_, symbols_)                                                                                         \
    {n_, -40.0f, 40.0f, IVL_FORM_TEXT(1.0f, "1/s", names_, symbols_,                                                                         \
        "threshold of RREV, 0.5 to 20 1/s: coefficients of 1, x = (v_x - 1.4 m/s) / (2 m/s), z = (v_z - 1.6 m/s) / (2 m/s) "                 \
        "and their products")}
// clang-format on

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
/// @param[in] rest             the IVL_GENERAL_N parameters behind those of the threshold
/// @param[in] p                ivl_general_point(seen)
/// @param[in] threshold_per_s  of RREV; limited to 0.5..20 1/s
ivl_action_t ivl_general_action(const float rest[], const ivl_seen_t *seen, const ivl_point_t *p, float threshold_per_s);

/// Largest moment of any p: the moment is linear, so it is that of a corner.
float ivl_general_moment_most_Nm(const float rest[]);

/// The row of a form for every approach, with the functions that the row names.  Its file has before it
///     static const ivl_form_group_t GROUPS[]                                  what the threshold_n_ parameters of the threshold mean,
///                                                                             in one group, then IVL_GENERAL_GROUPS
///     static float threshold_per_s(const float c[], const ivl_point_t *p)     the threshold of RREV at p
#define IVL_GENERAL_FORM(name_, threshold_n_, doc_)                                                                                        \
    static ivl_action_t decide(const float theta[], const ivl_seen_t *seen)                                                                \
    {                                                                                                                                      \
        const ivl_point_t p = ivl_general_point(seen);                                                                                     \
        return ivl_general_action(theta + (threshold_n_), seen, &p, threshold_per_s(theta, &p));                                           \
    }                                                                                                                                      \
    static float moment_most_Nm(const float theta[])                                                                                       \
    {                                                                                                                                      \
        return ivl_general_moment_most_Nm(theta + (threshold_n_));                                                                         \
    }                                                                                                                                      \
    const ivl_form_t ivl_form_##name_ = {                                                                                                  \
        .name = #name_,                                                                                                                    \
        IVL_FORM_DOC(doc_).groups = GROUPS,                                                                                                \
        .n_groups = 1 + IVL_GENERAL_N_GROUPS,                                                                                              \
        .n_params = (threshold_n_) + IVL_GENERAL_N,                                                                                        \
        .decide = decide,                                                                                                                  \
        .moment_most_Nm = moment_most_Nm,                                                                                                  \
    }
#endif  // IVL_GENERAL_H
