/// @file ivl_step.c
/// The pipeline on one page.
#include <string.h>

#include "ivl.h"
#include "ivl_landing.h"
#include "ivl_level_out.h"
#include "ivl_maneuver.h"

void ivl_init(const ivl_cfg_t *cfg, ivl_state_t *state)
{
    memset(state, 0, sizeof *state);
    ivl_sense_reset(&state->sense);
    state->phase = IVL_PHASE_IDLE;
    if (ivl_cfg_check(cfg) == IVL_OK)
    {
        state->derived = (ivl_derived_t){
            .dt_s = 1.0f / cfg->tick_hz,
            .tan_tilt_cmd_max = ivl_tan(cfg->tilt_cmd_rad_max),
            .cos_tilt_abort = ivl_sincos(cfg->tilt_abort_rad).cos,
            .cfg_good = true,
        };
        ivl_surface_init(cfg, &state->derived.surface);
    }
}

ivl_status_t ivl_reconfigure(ivl_cfg_t *cfg, ivl_state_t *state, const ivl_cfg_t *wanted)
{
    if (state->phase != IVL_PHASE_IDLE)
    {
        return IVL_ERR_PHASE;
    }
    const ivl_status_t status = ivl_cfg_check(wanted);
    if (status == IVL_OK)
    {
        const bool locked_out = state->guard.locked_out, triggered = state->triggered;
        *cfg = *wanted;
        ivl_init(cfg, state);
        state->guard.locked_out = locked_out;
        state->triggered = triggered;
    }
    return status;
}

ivl_status_t ivl_policy_commit(const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_policy_t *policy)
{
    // from the begin of an approach to the end of its cycle nothing that it was begun with changes: who asks for an approach has seen the policy
    const bool   open = (state->phase == IVL_PHASE_IDLE) || (state->phase == IVL_PHASE_READY);
    ivl_status_t status = ivl_policy_check(cfg, policy);
    status = open ? status : IVL_ERR_PHASE;
    if (status == IVL_OK)
    {
        state->policy = *policy;
        state->has_policy = true;
    }
    else
    {
        state->diag.n_policy_refused++;
    }
    return status;
}

static void count_faults(ivl_diag_t *diag, const ivl_sense_t *sense)
{
    diag->n_bad_pose += sense->pose_fresh ? 0u : 1u;
    diag->n_bad_command += sense->cmd_fresh ? 0u : 1u;
}

// all motors off
static void rest(const ivl_state_t *state, const ivl_seen_t *seen, ivl_out_t *out)
{
    memset(out, 0, sizeof *out);
    out->phase = state->phase;
    out->phase_log = (uint8_t)state->phase;
    out->stock_allowed = (state->phase == IVL_PHASE_IDLE) && !state->guard.locked_out;
    out->ceiling = seen->ceiling;
    out->cues = seen->cues;
}

// the tick in which an approach begins has enough to do
static void aim(const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_seen_t *seen)
{
    if ((state->approach.wants != (uint8_t)IVL_APPROACH_NOTHING) && (state->n_phase_tick > 1u))
    {
        const ivl_vitals_t *vitals = &state->guard.vitals;
        const ivl_room_t    room = {
            .d_ceil_m = seen->ceiling.valid ? seen->ceiling.d_ceil_m : 0.0f,
            .vbat_V = (vitals->given != 0u) ? vitals->vbat_V : 0.0f,
        };
        ivl_approach_aim(cfg, &state->approach, &room, state->distance.measured);
    }
}

// The point to hold.  One far below comes along with the vehicle, so far ahead of it that the errors leave the least lift: with more the vehicle
// falls, and so little lift does not keep it upright for long.
static ivl_vec3_t held(const ivl_cfg_t *cfg, const ivl_state_t *state)
{
    const float below_m = (1.0f - IVL_LIFT_NORM_MIN) * cfg->mass_kg * cfg->gravity_mps2 / cfg->kp_pos_z_Npm;
    const float z_m = state->sense.sample.p_WB_m.z - below_m;
    ivl_vec3_t  p_W_m = state->p_hold_W_m;
    p_W_m.z = (p_W_m.z < z_m) ? z_m : p_W_m.z;
    return p_W_m;
}

// what the tracking controller is to follow
static ivl_reference_t reference(const ivl_cfg_t *cfg, ivl_state_t *state, ivl_drive_t what, const ivl_seen_t *seen)
{
    if (what == IVL_DRIVE_LAND)
    {
        return ivl_landing_next(cfg, state);
    }
    if (what == IVL_DRIVE_APPROACH)
    {
        aim(cfg, state, seen);
        return ivl_approach_next(cfg, &state->approach, seen->cues.rrev_per_s, state->derived.dt_s);
    }
    if (what == IVL_DRIVE_LEVEL)
    {
        return ivl_level_out_next(cfg, state);
    }
    return (ivl_reference_t){.p_W_m = held(cfg, state)};
}

static void drive(const ivl_cfg_t *cfg, ivl_state_t *state, ivl_drive_t what, const ivl_seen_t *seen, float thrust_N[4])
{
    if (what == IVL_DRIVE_FLIP)
    {
        ivl_maneuver_thrusts(cfg, state->snapshot.action.moment_Nm, thrust_N);
        return;
    }
    const ivl_reference_t ref = reference(cfg, state, what, seen);
    const ivl_wrench_t    wrench = ivl_controller_compute(cfg, &state->sense.sample, &ref, state->derived.tan_tilt_cmd_max);
    ivl_mixer_thrusts(cfg, &wrench, thrust_N);
}

// sensed state -> contact, distance -> cues -> phase (the trigger is one of its conditions)
static void decide(const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_in_t *in, ivl_seen_t *seen)
{
    const float dt_s = state->derived.dt_s;
    state->guard.vitals = in->vitals;
    ivl_sense_update(cfg, &state->sense, in, dt_s);
    ivl_surface_see(cfg, &state->derived.surface, &state->sense.sample, &state->sense.rel);
    count_faults(&state->diag, &state->sense);
    ivl_contact_update(cfg, &state->contact, &state->sense, dt_s);
    if (!ivl_motors_latched_off(state))
    {
        // an approach that ends with this tick's request needs no estimate any more
        const bool is_approach = (state->phase == IVL_PHASE_APPROACH) && (state->sense.cmd.request == IVL_REQUEST_APPROACH);
        seen->ceiling = ivl_distance_update(cfg, &state->distance, &state->sense, in, is_approach, dt_s);
        seen->cues = ivl_cues_compute(seen->ceiling, state->sense.rel.along_mps);
        ivl_cues_take_flow(cfg, in, &seen->cues);
    }
    ivl_phase_update(cfg, state, seen);
}

// all of a tick but the thrusts
static ivl_drive_t begin(const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_in_t *in, ivl_out_t *out, ivl_seen_t *seen)
{
    state->diag.n_tick++;
    // a finished landing only waits for the end of its request cycle
    if ((state->phase != IVL_PHASE_DONE) || (in->cmd.request == IVL_REQUEST_IDLE))
    {
        decide(cfg, state, in, seen);
    }
    rest(state, seen, out);
    return ivl_phase_drive(state);
}

void ivl_step(const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_in_t *in, ivl_out_t *out)
{
    ivl_seen_t        seen = {.cues = {.valid = false}};
    const ivl_drive_t what = begin(cfg, state, in, out, &seen);
    // phase -> thrusts -> PWM
    if (what != IVL_DRIVE_OFF)
    {
        out->motors_on = true;
        drive(cfg, state, what, &seen, out->thrust_N);
        ivl_pwm_of_thrust(cfg, out->thrust_N, out->pwm);
        const ivl_wrench_t made = ivl_mixer_wrench(cfg, out->thrust_N);
        out->pitch_moment_Nm = made.moment_B_Nm.y;
        out->thrust_total_N = made.thrust_N;
    }
}

#ifdef IVL_SIDE_BY_SIDE
bool ivl_step_decide(const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_in_t *in, ivl_out_t *out, ivl_reference_t *ref)
{
    ivl_seen_t        seen = {.cues = {.valid = false}};
    const ivl_drive_t what = begin(cfg, state, in, out, &seen);
    const bool        follows = (what != IVL_DRIVE_OFF) && (what != IVL_DRIVE_FLIP);
    out->motors_on = what != IVL_DRIVE_OFF;
    if (follows)
    {
        *ref = reference(cfg, state, what, &seen);
    }
    else if (out->motors_on)
    {
        ivl_maneuver_thrusts(cfg, state->snapshot.action.moment_Nm, out->thrust_N);
    }
    return follows;
}
#endif
