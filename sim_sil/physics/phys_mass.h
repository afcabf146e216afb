/// @file phys_mass.h
/// Which feet hold on, and the mass that the body has with them.  A stuck foot is a foot of infinite mass: its inverse mass is
/// zero, and the same equations hold.                                                            [MODEL eq. 4.8]
#ifndef IVL_PHYS_MASS_H
#define IVL_PHYS_MASS_H

#include "phys_matrix.h"
#include "sim_model.h"

typedef enum
{
    IVL_SIM_FOOT_FREE,
    IVL_SIM_FOOT_SLIDING,  ///< pressed on the surface, not yet stuck
    IVL_SIM_FOOT_STUCK,
} ivl_sim_foot_t;

enum
{
    IVL_SIM_PACKED = 21  ///< upper triangle of a symmetric 6 x 6 matrix, row by row
};

/// What follows from the feet that hold on.
typedef struct
{
    ivl_wide_t inverse_mass[IVL_SIM_LEGS];  ///< of the foot, 1/kg; 0 when stuck
    ivl_wide_t sliding[IVL_SIM_LEGS];       ///< 1 for a sliding foot, else 0
    ivl_wide_t mass6[IVL_SIM_PACKED];       ///< body and hip ends of the legs, about the body origin, body axes
    ivl_wide_t inverse_mass6[IVL_SIM_PACKED];
    bool       any_sliding;  ///< in any lane
} ivl_sim_contact_t;

/// Place of element (i, j), i <= j, in a packed symmetric matrix.
IVL_SIM_INLINE int ivl_sim_packed(int i, int j)
{
    const int a = (i < j) ? i : j, b = (i < j) ? j : i;
    return a * IVL_SIM_TWIST - a * (a - 1) / 2 + b - a;
}

/// Tells lane `lane` which feet hold on.
void ivl_sim_contact_set(const ivl_sim_model_t *model, ivl_sim_contact_t *contact, int lane, const ivl_sim_foot_t foot[IVL_SIM_LEGS]);

/// The same feet in all lanes.
void ivl_sim_contact_spread(const ivl_sim_model_t *model, ivl_sim_contact_t *contact, const ivl_sim_foot_t foot[IVL_SIM_LEGS]);

/// Inverse mass in the lanes in which a foot slides; other lanes stay as they are.  A sliding foot does not yield along the
/// surface's normal: its hip carries more mass in that direction, which turns with the body, so that the matrix must be made
/// anew at each evaluation.
/// @param[in] normal_B  the surface's normal in body axes
void ivl_sim_mass_while_sliding(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact, const ivl_w3_t *normal_B,
                                ivl_wide_t inverse6[IVL_SIM_PACKED]);

#endif  // IVL_PHYS_MASS_H
