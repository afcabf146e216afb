/// @file sim_world.h
/// One vehicle under one ceiling: sensors, flight core, rotors, body and legs, contact events, advanced tick by tick.
#ifndef IVL_SIM_WORLD_H
#define IVL_SIM_WORLD_H

#include "sim_rotor.h"
#include "sim_sensors.h"

/// The first contact of any foot or plate with the ceiling, just before it acts.
typedef struct
{
    bool happened;
    double t_s;
    ivl_sim_kin_t kin;
} ivl_sim_impact_t;

typedef struct
{
    const ivl_sim_model_t *model;
    ivl_sim_rng_t rng;
    double t_s;
    uint32_t n_tick; ///< ticks of the flight core since the start
    uint32_t n_step; ///< integration steps since the start
    double step_s;   ///< next integration step, graded after events
    ivl_sim_kin_t kin;
    ivl_sim_contact_t contact;
    ivl_sim_rotor_t rotor;
    ivl_sim_sensors_t sensors;
    double a_W_mps2[3]; ///< acceleration at the start of the last step
    ivl_state_t firmware;
    ivl_in_t in;
    ivl_out_t out;
    ivl_sim_impact_t impact;
    double t_touch_s[IVL_SIM_LEGS];       ///< since when a sliding foot presses
    bool detached[IVL_SIM_LEGS];          ///< came off; cannot stick again before it has moved away
    int8_t stuck_order[IVL_SIM_LEGS];     ///< leg numbers 1..4 in the order of first sticking, 0 none
    int n_order;
    bool plate_touched[IVL_SIM_PLATES];
    double d_min_m;       ///< smallest distance of the body origin from the ceiling's surface
} ivl_sim_world_t;

/// A vehicle in free flight at (p, v), level, rotors at hover, legs at rest; the core in IDLE.
void ivl_sim_world_init(const ivl_sim_model_t *model, const ivl_sim_rng_t *rng, const double p_W_m[3],
                        const double v_W_mps[3], ivl_sim_world_t *world);

/// One tick of the flight core (skipped while its motors are latched off) and the motion until the next.
void ivl_sim_world_tick(ivl_sim_world_t *world);

/// Motion alone, for dt, with the rotor commands as they are.
void ivl_sim_world_advance(ivl_sim_world_t *world, double dt_s);

int ivl_sim_world_count_stuck(const ivl_sim_world_t *world);

#endif // IVL_SIM_WORLD_H
