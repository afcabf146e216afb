#include "phys_plates.h"

double ivl_sim_plate_top(const ivl_sim_plate_t *plate, ivl_d3_t normal_B)
{
    return fabs(normal_B.x) * plate->half_m[0] + fabs(normal_B.y) * plate->half_m[1] + fabs(normal_B.z) * plate->half_m[2] +
           normal_B.z * plate->center_z_m;
}

double ivl_sim_plate_energy(const ivl_sim_model_t *model, const ivl_sim_plate_t *plate, ivl_d3_t normal_B, double height_m,
                            double surface_height_m)
{
    double energy = 0.0;
    for (int i = 0; i < IVL_SIM_CORNERS; i++)
    {
        const ivl_d3_t x = plate->corner_B_m[i];
        const double   depth = height_m + ivl_d3_dot(normal_B, x) - surface_height_m;
        energy += (depth > 0.0) ? 0.5 * model->raw.plate_stiffness_Npm * depth * depth : 0.0;
    }
    return energy;
}
