/// @file world_rollout.h
/// One landing: a start, ticks until an end, an outcome.
#ifndef IVL_WORLD_ROLLOUT_H
#define IVL_WORLD_ROLLOUT_H

#include "world_group.h"

typedef enum
{
    IVL_SIM_START_IMPARTED,    ///< level, at the approach velocity, closing speed * 1 s before the surface (RREV = 1)
    IVL_SIM_START_FLOWN,       ///< hovering, far enough to reach the speed and hold it for start.hold_time
    IVL_SIM_START_AT_TRIGGER,  ///< level, at the approach velocity, at a stated distance; the flip starts at once
    IVL_SIM_START_STATE,       ///< any state of free flight, for example a recorded one; the approach goes on from there
    IVL_SIM_START_COUNT
} ivl_sim_start_t;

typedef enum
{
    IVL_SIM_END_CONTACT_TIME,  ///< end.contact_time after the first contact
    IVL_SIM_END_MISSED,        ///< motors cut, and too slow to reach the surface any more
    IVL_SIM_END_MISSED_TIME,   ///< end.missed_time after the trigger, without a contact
    IVL_SIM_END_TIME_MAX,      ///< end.time_max after the start
    IVL_SIM_END_REFUSED,       ///< the flight core refused the policy
    IVL_SIM_END_NOT_FINITE,    ///< the state ceased to be finite: a defect, or absurd parameters
    IVL_SIM_END_STEP_LIMIT,    ///< the motion took more work than any landing needs: a defect, or absurd parameters
    IVL_SIM_END_NO_GO,         ///< the policy called the approach off, and the vehicle hovers
    IVL_SIM_END_COUNT
} ivl_sim_end_t;

#define IVL_SIM_THETAS 64

/// X(c_type, name, count, numpy_type, unit, lo, hi, default, doc)
// clang-format off
#define IVL_SIM_SPEC_FIELDS(X) \
    X(double, speed_mps, 1, "f8", "m/s", 0.1, 6.0, IVL_SIM_REQUIRED, "approach speed V, as seen from the surface") \
    X(double, angle_deg, 1, "f8", "deg", 0.0, 180.0, IVL_SIM_REQUIRED, "approach angle phi, between the velocity as seen from the surface and the surface: above a ceiling's horizontal; beyond 90 backwards along it") \
    X(double, theta, IVL_SIM_THETAS, "f8", "SI", -IVL_SIM_UNLIMITED, IVL_SIM_UNLIMITED, 0, "policy: parameters of its form, SI; their ranges are those of the form") \
    X(double, d_ceil_m, 1, "f8", "m", 0.02, 10.0, 0.5, "start at_trigger: distance of the body origin from the plane of the cues") \
    X(uint64_t, seed, 1, "u8", "1", 0, 18446744073709551615.0, 0, "of the batch") \
    X(uint64_t, stream, 1, "u8", "1", 0, 18446744073709551615.0, 0, "number of the rollout within the seed") \
    X(int32_t, start, 1, "i4", "1", 0, IVL_SIM_START_COUNT - 1, 0, "0 imparted, 1 flown, 2 at_trigger, 3 state") \
    X(int32_t, form, 1, "i4", "1", 0, 255, 0, "policy: its form, row of IVL_FORMS") \
    X(double, p_start_W_m, 3, "f8", "m", -100, 100, 0, "start state: body origin in the world, before the surface") \
    X(double, v_start_W_mps, 3, "f8", "m/s", -20, 20, 0, "start state: velocity in the world") \
    X(double, q_start_WB, 4, "f8", "1", -1, 1, 0, "start state: attitude, x y z w, of unit length") \
    X(double, w_start_B_radps, 3, "f8", "rad/s", -100, 100, 0, "start state: angular rate in body axes") \
    X(double, rotor_start_radps, 4, "f8", "rad/s", -1, 100000, -1, "start state: rotor speeds; below 0: at hover") \
    X(double, battery_start_V, 1, "f8", "V", 0, 30, 0, "start state: open-circuit voltage; 0: the vehicle's own, with its scatter") \
    X(double, flip_at_s, 1, "f8", "s", 0, 60, 0, "form constant: time of the first tick that may flip, and does if it sees the ceiling close; 0: the threshold decides")

#define IVL_SIM_OUTCOME_FIELDS(X) \
    X(int32_t, n_legs, 1, "i4", "1", 0, 4, 0, "feet stuck at the end") \
    X(int8_t, leg_order, 4, "i1", "1", 0, 4, 0, "legs 1..4 in the order of first sticking, then 0") \
    X(int32_t, body_contact, 1, "i4", "1", 0, 1, 0, "1 if the propeller plate touched the surface") \
    X(int32_t, base_contact, 1, "i4", "1", 0, 1, 0, "1 if the base plate touched the surface") \
    X(int32_t, end_reason, 1, "i4", "1", 0, IVL_SIM_END_COUNT - 1, 0, "why the rollout ended") \
    X(int32_t, triggered, 1, "i4", "1", 0, 1, 0, "1 if the flip was started") \
    X(int32_t, decided, 1, "i4", "1", 0, 1, 0, "1 if the policy was asked whether to go") \
    X(int32_t, no_go, 1, "i4", "1", 0, 1, 0, "1 if the policy called the approach off") \
    X(double, t_trigger_s, 1, "f8", "s", 0, 60, IVL_SIM_REQUIRED, "time of the trigger") \
    X(double, t_impact_s, 1, "f8", "s", 0, 60, IVL_SIM_REQUIRED, "time of the first contact") \
    X(double, t_end_s, 1, "f8", "s", 0, 60, IVL_SIM_REQUIRED, "duration of the rollout") \
    X(double, theta_impact_deg, 1, "f8", "deg", -3600, 3600, IVL_SIM_REQUIRED, "nose-up rotation about b_y at the first contact, unwrapped") \
    X(double, vx_trigger_mps, 1, "f8", "m/s", -20, 20, IVL_SIM_REQUIRED, "true speed forward along the surface, as seen from there, at the trigger; of a ceiling at rest along x") \
    X(double, vz_trigger_mps, 1, "f8", "m/s", -20, 20, IVL_SIM_REQUIRED, "true closing speed at the trigger; of a ceiling at rest along z") \
    X(double, rate_trigger_radps, 1, "f8", "rad/s", -200, 200, IVL_SIM_REQUIRED, "nose-up rate at the trigger") \
    X(double, vx_impact_mps, 1, "f8", "m/s", -20, 20, IVL_SIM_REQUIRED, "speed forward along the surface at the first contact") \
    X(double, vz_impact_mps, 1, "f8", "m/s", -20, 20, IVL_SIM_REQUIRED, "closing speed at the first contact") \
    X(double, rate_impact_radps, 1, "f8", "rad/s", -200, 200, IVL_SIM_REQUIRED, "nose-up rate at the first contact") \
    X(double, d_trigger_m, 1, "f8", "m", 0, 20, IVL_SIM_REQUIRED, "sensed distance latched at the trigger") \
    X(double, d_true_trigger_m, 1, "f8", "m", 0, 20, IVL_SIM_REQUIRED, "true distance from the plane of the cues at the trigger") \
    X(double, d_sigma_trigger_m, 1, "f8", "m", 0, 20, IVL_SIM_REQUIRED, "standard deviation that the flight core gave the sensed distance at the trigger") \
    X(double, d_valid_norm, 1, "f8", "1", 0, 1, IVL_SIM_REQUIRED, "share of the approach's ticks with a valid distance, up to the trigger") \
    X(double, rrev_trigger, 1, "f8", "1/s", 0, 1000, IVL_SIM_REQUIRED, "RREV latched at the trigger") \
    X(double, of_y_trigger, 1, "f8", "rad/s", -1000, 1000, IVL_SIM_REQUIRED, "OF_y latched at the trigger") \
    X(double, p_land, 1, "f8", "1", 0, 1, IVL_SIM_REQUIRED, "probability of a landing by which go or no-go was decided") \
    X(double, d_decided_m, 1, "f8", "m", 0, 20, IVL_SIM_REQUIRED, "sensed distance at which go or no-go was decided") \
    X(double, d_min_m, 1, "f8", "m", -1, 20, IVL_SIM_REQUIRED, "smallest distance of the body origin from the surface") \
    X(uint32_t, n_steps, 1, "u4", "1", 0, 4294967295.0, 0, "integration steps") \
    X(uint32_t, n_ticks, 1, "u4", "1", 0, 4294967295.0, 0, "ticks of the flight core's clock")

#define IVL_SIM_TRACE_FIELDS(X) \
    X(double, t_s, 1, "f8", "s", 0, 60, IVL_SIM_REQUIRED, "time since the start") \
    X(double, p_WB_m, 3, "f8", "m", -100, 100, IVL_SIM_REQUIRED, "body origin in the world") \
    X(double, q_WB, 4, "f8", "1", -1, 1, IVL_SIM_REQUIRED, "attitude, x y z w") \
    X(double, v_WB_mps, 3, "f8", "m/s", -50, 50, IVL_SIM_REQUIRED, "velocity in the world") \
    X(double, w_B_radps, 3, "f8", "rad/s", -500, 500, IVL_SIM_REQUIRED, "angular rate in body axes") \
    X(double, pitch_deg, 1, "f8", "deg", -3600, 3600, IVL_SIM_REQUIRED, "nose-up rotation, unwrapped") \
    X(double, thrust_N, 4, "f8", "N", 0, 100, IVL_SIM_REQUIRED, "thrust of each motor") \
    X(double, thrust_cmd_N, 4, "f8", "N", 0, 100, IVL_SIM_REQUIRED, "thrust commanded by the flight core") \
    X(double, battery_V, 1, "f8", "V", 0, 30, IVL_SIM_REQUIRED, "battery voltage under load; 0 for a supply that never sags") \
    X(double, foot_W_m, 12, "f8", "m", -100, 100, IVL_SIM_REQUIRED, "feet 1..4, x y z each") \
    X(int8_t, foot_state, 4, "i1", "1", 0, 2, 0, "0 free, 1 sliding, 2 stuck") \
    X(int32_t, phase, 1, "i4", "1", 0, IVL_PHASE_COUNT - 1, 0, "of the flight core") \
    X(int32_t, body_contact, 1, "i4", "1", 0, 1, 0, "1 once the propeller plate has touched") \
    X(double, d_ceil_m, 1, "f8", "m", -1, 20, IVL_SIM_REQUIRED, "true distance of the body origin from the surface") \
    X(double, d_sensed_m, 1, "f8", "m", 0, 20, IVL_SIM_REQUIRED, "distance as the flight core sees it; 0 when it has none") \
    X(double, d_sigma_m, 1, "f8", "m", 0, 20, IVL_SIM_REQUIRED, "its standard deviation, as the flight core gives it") \
    X(double, rrev_per_s, 1, "f8", "1/s", -1000, 1000, IVL_SIM_REQUIRED, "RREV as the flight core sees it") \
    X(double, of_y_radps, 1, "f8", "rad/s", -1000, 1000, IVL_SIM_REQUIRED, "OF_y as the flight core sees it") \
    X(double, energy_J, 1, "f8", "J", -100, 100, IVL_SIM_REQUIRED, "kinetic, gravitational and elastic energy")
// clang-format on

#define IVL_SIM_MEMBER(c_type, name, count, np, unit, lo, hi, dflt, doc) c_type name[count];
typedef struct
{
    IVL_SIM_SPEC_FIELDS(IVL_SIM_MEMBER)
} ivl_sim_spec_t;
typedef struct
{
    IVL_SIM_OUTCOME_FIELDS(IVL_SIM_MEMBER)
} ivl_sim_outcome_t;
typedef struct
{
    IVL_SIM_TRACE_FIELDS(IVL_SIM_MEMBER)
} ivl_sim_trace_t;
#undef IVL_SIM_MEMBER

/// Receives a row after the start and then every period, up to the end.
typedef struct
{
    double           period_s;
    ivl_sim_trace_t *rows;
    size_t           capacity;  ///< of `rows`
    size_t           n;         ///< rows that the landing has; those beyond the capacity are counted, not written
} ivl_sim_tracer_t;

/// One landing to fly, and where its result goes.
typedef struct
{
    const ivl_sim_spec_t *spec;
    ivl_sim_outcome_t    *outcome;
    ivl_sim_tracer_t     *tracer;  ///< NULL for none
} ivl_sim_job_t;

/// Gives the next landing to fly; false when there are no more.
typedef bool (*ivl_sim_source_t)(void *context, ivl_sim_job_t *job);

/// Evaluations that the lanes could have made, and those that landings asked for: their quotient is the occupancy.
typedef struct
{
    uint64_t offered, used;
} ivl_sim_work_t;

/// Flies all landings of a source, several at a time.  Each outcome depends on its spec alone.
ivl_sim_work_t ivl_sim_fly(const ivl_sim_model_t *model, ivl_sim_source_t source, void *context);
ivl_sim_work_t IVL_SIM_OF_WIDTH(ivl_sim_fly)(const ivl_sim_model_t *model, ivl_sim_source_t source, void *context);

// The parts of ivl_sim_fly, for a world that goes on before and after its landings.

/// The policy of a specification: number 1, parameters rounded once, as a host rounds them for the radio.
ivl_policy_t ivl_sim_policy(int32_t form, const double theta[IVL_SIM_THETAS], bool at_once);

/// True if every field is within its range.
bool ivl_sim_spec_good(const ivl_sim_spec_t *spec);

/// Puts a vehicle to the start of a landing, whose fields are within their ranges.  The first tick is then due.
/// @return false if the flight core refuses the policy
bool ivl_sim_rollout_start(ivl_sim_group_t *group, int lane, const ivl_sim_spec_t *spec);

/// Nothing has happened yet: counts 0, numbers that have no value NaN.
void ivl_sim_outcome_clear(ivl_sim_outcome_t *outcome);

/// After each tick: takes note of the trigger.
void ivl_sim_rollout_note(const ivl_sim_group_t *group, int lane, ivl_sim_outcome_t *outcome);

/// Between two ticks: true if the landing is over, and then the outcome is complete.
bool ivl_sim_rollout_ended(const ivl_sim_group_t *group, int lane, ivl_sim_outcome_t *outcome);

/// One row of a time series: the present instant, and what the core did at its last tick.
void ivl_sim_rollout_row(const ivl_sim_group_t *group, int lane, ivl_sim_trace_t *row);

/// Lower-case name of an end, "?" for a number that is none.
const char *ivl_sim_end_name(int end);

#endif  // IVL_WORLD_ROLLOUT_H
