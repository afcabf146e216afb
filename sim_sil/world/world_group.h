/// @file world_group.h
/// Vehicles and a surface to land on: sensors, flight core, rotors, body and legs, contact events.
///
/// As many worlds as there are lanes form a group and share each integration step; each has its own clock, step length and events, and no
/// world's bits depend on the others'.  One world alone is a group whose
/// other lanes are empty.
#ifndef IVL_WORLD_GROUP_H
#define IVL_WORLD_GROUP_H

#include "phys_mass.h"
#include "phys_rotor.h"
#include "phys_state.h"
#include "sim_autopilot.h"
#include "world_drive.h"
#include "world_sensors.h"
#include "world_sight.h"

enum
{
    IVL_SIM_GAPS = IVL_SIM_LEGS + IVL_SIM_PLATES  ///< distances that make an event: feet, then plates
};

/// The first contact of any foot or plate with the surface, just before it acts.
typedef struct
{
    bool          happened;
    double        t_s;
    ivl_sim_kin_t kin;
} ivl_sim_impact_t;

/// How far each world is, and the steps by which it goes on.
typedef struct
{
    ivl_wide_t  t_s;
    ivl_wide_t  left_s;            ///< of the present tick; 0 in an empty lane
    ivl_whole_t n_step;            ///< integration steps since the start
    ivl_whole_t n_evaluation;      ///< evaluations of the forces since the start: steps and tries
    ivl_whole_t evaluations_left;  ///< of the present tick
    ivl_wide_t  graded_s;          ///< next integration step, graded after events
    ivl_wide_t  step_s;            ///< the same, or what the legs allow if that is shorter
    ivl_mask_t  restart;           ///< the forces have jumped since the last evaluation
    ivl_wide_t  surface_m;         ///< height of the surface at time 0
    ivl_wide_t  d_min_m;           ///< smallest distance of the body origin from the surface
    // the step that is being tried
    ivl_wide_t       dt_s;
    ivl_mask_t       starting;                   ///< evaluates only: the forces have jumped
    ivl_mask_t       powered;                    ///< some rotor turns
    ivl_sim_rotors_t rotor;                      ///< after the step, if powered
    ivl_whole_t      n_try;                      ///< 0 at first; more while a contact is being located
    ivl_wide_t       gap_m[IVL_SIM_GAPS];        ///< before the step
    ivl_wide_t       gap_after_m[IVL_SIM_GAPS];  ///< after it; before the next
} ivl_sim_progress_t;

/// What the feet and plates of each world do, as far as each step asks for it: see ivl_sim_world_note_contact.
typedef struct
{
    ivl_mask_t may_touch[IVL_SIM_GAPS];  ///< a foot that may stick, a plate that has not touched yet
    ivl_wide_t hold_N[IVL_SIM_LEGS];     ///< pull up to which a foot is held; unlimited where none is
    ivl_wide_t t_touch_s[IVL_SIM_LEGS];  ///< since when a sliding foot presses
    ivl_mask_t sliding;                  ///< some foot
    ivl_mask_t detached;                 ///< likewise
    ivl_mask_t all_stuck;                ///< all feet
    ivl_mask_t impacted;                 ///< something has touched
} ivl_sim_touch_t;

typedef struct
{
    const ivl_sim_model_t *model;
    ivl_sim_rng_t          rng;
    uint32_t               n_tick;                         ///< ticks of the flight core since the start
    bool                   gave_up;                        ///< a tick took more than it can have: what follows is no motion
    uint32_t               n_approach_tick, n_valid_tick;  ///< ticks of the approach, and those with a valid distance
    ivl_sim_foot_t         foot[IVL_SIM_LEGS];
    ivl_sim_sensors_t      sensors;
    ivl_sim_sight_t        sight;
    ivl_state_t            firmware;
    ivl_in_t               in;  ///< what the sensors say, and the command
    ivl_sim_autopilot_t    autopilot;
    ivl_out_t              out;
    ivl_sim_impact_t       impact;
    bool                   detached[IVL_SIM_LEGS];     ///< came off; cannot stick again before it has moved away
    int8_t                 stuck_order[IVL_SIM_LEGS];  ///< leg numbers 1..4 in the order of first sticking, 0 none
    int                    n_order;
    bool                   plate_touched[IVL_SIM_PLATES];
} ivl_sim_world_t;

typedef struct
{
    const ivl_sim_model_t *model;
    void                  *port;  ///< of the flight cores
    void                  *eyes;  ///< port of the model's camera; NULL: there is none
    ivl_sim_state_t        state, next;
    ivl_sim_rate_t         last, rate;
    ivl_sim_contact_t      contact;
    ivl_sim_load_t         load;
    ivl_sim_rotors_t       rotor;
    ivl_sim_progress_t     progress;
    ivl_sim_touch_t        touch;
    ivl_sim_drive_t        drive;
    bool                   active[IVL_SIM_LANES];
    ivl_sim_world_t        world[IVL_SIM_LANES];
} ivl_sim_group_t;

/// What a vehicle in free flight starts with; legs at rest on the body.
typedef struct
{
    double p_W_m[3], v_W_mps[3];
    double q_WB[4];                      ///< x, y, z, w; of unit length
    double w_B_radps[3];                 ///< angular rate, body axes
    double rotor_radps[IVL_SIM_MOTORS];  ///< rotor speeds, commanded as well until the first tick
    double battery_V;                    ///< open-circuit voltage; 0: the model's, with its scatter
} ivl_sim_start_state_t;

/// All lanes empty.
void ivl_sim_group_init(const ivl_sim_model_t *model, ivl_sim_group_t *group);

/// Puts a vehicle into a lane: in free flight, level, rotors at hover, legs at rest; the core in IDLE.
void ivl_sim_world_start(ivl_sim_group_t *group, int lane, const ivl_sim_rng_t *rng, const double p_W_m[3], const double v_W_mps[3]);

/// Puts a vehicle into a lane, in free flight; the core in IDLE.
void ivl_sim_world_start_from(ivl_sim_group_t *group, int lane, const ivl_sim_rng_t *rng, const ivl_sim_start_state_t *start);

/// Replaces the state of motion, for tests; the feet hold on as before.
void ivl_sim_world_place(ivl_sim_group_t *group, int lane, const ivl_sim_kin_t *kin);

/// Legs at rest on a body that moves without turning: fills in the feet of `kin`.
void ivl_sim_world_rest_legs(const ivl_sim_model_t *model, ivl_sim_kin_t *kin);

/// Within a tick: this tick becomes the first one, at time 0, of a vehicle that has touched nothing yet.  Motion and sensors go on.
void ivl_sim_world_rebase(ivl_sim_group_t *group, int lane);

/// After a change of what a world's feet and plates do.
void ivl_sim_world_note_contact(ivl_sim_group_t *group, int lane);

/// Time since the start.
IVL_SIM_INLINE double ivl_sim_world_time_s(const ivl_sim_group_t *group, int lane)
{
    return group->progress.t_s[lane];
}

/// Height of the surface along its normal, at present.
double ivl_sim_world_surface_m(const ivl_sim_group_t *group, int lane);

/// Distance of the body origin from the surface, at present.
double ivl_sim_world_gap_m(const ivl_sim_group_t *group, int lane);

/// State of motion of one vehicle.
ivl_sim_kin_t ivl_sim_world_kin(const ivl_sim_group_t *group, int lane);

/// A tick of the flight core (skipped while its motors are latched off) in each lane in which one is due; the motion until the next one then is.
void ivl_sim_world_ticks(ivl_sim_group_t *group, const bool due[IVL_SIM_LANES]);

/// The same for one lane.
void ivl_sim_world_tick(ivl_sim_group_t *group, int lane);

/// True when the motion that was due is done: the next tick can begin.
bool ivl_sim_world_ready(const ivl_sim_group_t *group, int lane);

/// One integration step, or one try of it, of every active world that is not ready.  After so many of them each world is ready
/// or has given up, which makes it ready, too.
void ivl_sim_group_step(ivl_sim_group_t *group);

/// True for a motion that is no longer one: not finite, or faster than anything that flies.
bool ivl_sim_world_diverged(const ivl_sim_state_t *state, int lane);

int ivl_sim_world_count_stuck(const ivl_sim_world_t *world);

#endif  // IVL_WORLD_GROUP_H
