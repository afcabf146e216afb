/// @file sensors_fixture.h
/// Sensors of a vehicle whose motion is given, for tests of what they tell.
#ifndef SENSORS_FIXTURE_H
#define SENSORS_FIXTURE_H
#include "sim_fixture.h"
#include "world_sensors.h"

static ivl_sim_sensors_t sensors;

/// Uniformly accelerated: x = t, z = z0 + 2 t + 1.5 t^2.
static inline ivl_sim_kin_t accelerated(double z0_m, double t)
{
    return (ivl_sim_kin_t){
        .p_WB_m = {t, 0.0, z0_m + 2.0 * t + 1.5 * t * t}, .v_WB_mps = {1.0, 0.0, 2.0 + 3.0 * t}, .q_WB = {0.0, 0.0, 0.0, 1.0}};
}

static const double A_MOVING[3] = {0.0, 0.0, 3.0};

static inline void look(const ivl_sim_model_t *model, const ivl_sim_rng_t *rng, const ivl_sim_kin_t *kin, const double a_W_mps2[3],
                        double t, ivl_in_t *in)
{
    const ivl_sim_scene_t scene = {.model = model,
                                   .kin = kin,
                                   .surface_height_m = ivl_sim_surface_height(&model->surface, 0.0),
                                   .a_W_mps2 = {a_W_mps2[0], a_W_mps2[1], a_W_mps2[2]}};
    ivl_sim_sensors_read(&scene, rng, t, &sensors, in);
}
#endif  // SENSORS_FIXTURE_H
