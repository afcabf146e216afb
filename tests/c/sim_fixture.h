/// @file sim_fixture.h
/// Shared by the tests of the simulator: a vehicle with its gear, random states that its legs allow, one vehicle in a group.
#ifndef SIM_FIXTURE_H
#define SIM_FIXTURE_H
#include "phys_energy.h"
#include "phys_impulse.h"
#include "phys_plates.h"
#include "phys_step.h"
#include "unity.h"
#include "world_group.h"

/// Random cases of a test. AddressSanitizer takes five times as long for each, and finds a fault of memory in fewer.
#if defined(__SANITIZE_ADDRESS__)
#define CASES(n) ((n) / 5)
#else
#define CASES(n) (n)
#endif

/// splitmix64: the same draws on every machine, and none of the simulator's own generator.
typedef struct
{
    uint64_t state;
} draws_t;

uint64_t draw_u64(draws_t *draws);
double   draw(draws_t *draws, double lo, double hi);
ivl_d3_t draw_d3(draws_t *draws, double limit);
void     draw_quat(draws_t *draws, double q[4]);

/// The paper's vehicle with Wide-Short legs as simulated; no gap between the ceiling and the plane of the cues.
ivl_sim_params_t fixture_params(void);

/// Model of these parameters with the core's default flight parameters; fails the test if it is refused.
ivl_sim_model_t fixture_model(const ivl_sim_params_t *params);

/// Any attitude and velocity, legs deflected by up to `bend` from their rest direction and turning, all within what rigid
/// legs allow; feet far below the ceiling.
ivl_sim_kin_t draw_kin(const ivl_sim_model_t *model, draws_t *draws, double bend);

/// Level body at p, at rest, legs at rest.
ivl_sim_kin_t resting_kin(const ivl_sim_model_t *model, double x, double y, double z);

/// Turns a resting vehicle to attitude q about its origin, feet included.
void turn_kin(const ivl_sim_model_t *model, const double q[4], ivl_sim_kin_t *kin);

/// Attitude after a nose-up rotation by `angle` about b_y.
void nose_up(double angle, double q[4]);

/// One vehicle in lane 0 of an otherwise empty group, motors at rest, no flight core in the loop.
/// @param[in] held  feet that hold on from the start, where they are
/// Thrust commands of the vehicle in lane 0.
void command_rotors(ivl_sim_group_t *group, const float thrust_N[IVL_SIM_MOTORS]);

/// Rotors that stand still, and are told to.
void stop_rotors(ivl_sim_group_t *group, int lane);

void place_alone(const ivl_sim_model_t *model, ivl_sim_group_t *group, const ivl_sim_kin_t *kin, const ivl_sim_foot_t held[IVL_SIM_LEGS]);

/// Motion alone, for dt, with the rotor commands as they are; of all active worlds.  A world that takes more evaluations than
/// such a motion can need gives up: it stays where it is, and `gave_up` says so.
void advance(ivl_sim_group_t *group, double dt_s);

/// Accelerations of one vehicle, by a step of no length.
ivl_sim_rate_t evaluate(const ivl_sim_model_t *model, const ivl_sim_kin_t *kin, const ivl_sim_foot_t foot[IVL_SIM_LEGS], double thrust_N,
                        ivl_d3_t torque_B_Nm);

/// Largest difference in length of a rod from what it should be.
double rod_error(const ivl_sim_model_t *model, const ivl_sim_kin_t *kin);

/// Energy of one vehicle before a surface at rest.
double energy_at_rest(const ivl_sim_model_t *model, const ivl_sim_kin_t *kin);

double total_energy(const ivl_sim_group_t *group);

#endif  // SIM_FIXTURE_H
