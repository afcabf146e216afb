#include "phys_plates.h"

double ivl_sim_plate_top(const ivl_sim_plate_t *plate, ivl_d3_t up)
{
    return fabs(up.x) * plate->half_m[0] + fabs(up.y) * plate->half_m[1] + fabs(up.z) * plate->half_m[2] + up.z * plate->center_z_m;
}

double ivl_sim_plate_energy(const ivl_sim_model_t *model, const ivl_sim_plate_t *plate, ivl_d3_t up, double height_m)
{
    double energy = 0.0;
    for (int i = 0; i < IVL_SIM_CORNERS; i++)
    {
        const ivl_d3_t x = plate->corner_B_m[i];
        const double   depth = height_m + ivl_d3_dot(up, x) - model->raw.world_ceiling_height_m;
        energy += (depth > 0.0) ? 0.5 * model->raw.plate_stiffness_Npm * depth * depth : 0.0;
    }
    return energy;
}
