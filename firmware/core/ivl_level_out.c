/// @file ivl_level_out.c
#include "ivl_level_out.h"

#include "ivl_math.h"

// the vehicle hovers at least this far below its highest point and before the farthest side of the fence, and goes there at this speed
static const float DROP_M = 0.25f;
static const float RETREAT_MPS = 1.0f;

// the distance may be this many standard deviations shorter than it seems
static const float SURE_SIGMAS = 2.0f;

float ivl_level_out_rise_m(const ivl_cfg_t *cfg, const ivl_surface_t *surface, float v_close_mps, float thrust_mps2)
{
    if (!(v_close_mps > 0.0f))
    {
        return 0.0f;
    }
    const float kept_mps2 = IVL_LIFT_NORM_MIN * cfg->gravity_mps2;
    const float twice_brake_mps2 = 2.0f * surface->brake_mps2;
    // the thrust that fades with motor_lag adds this much speed, and adds it late; a slow vehicle turns before that
    const float more_mps = ivl_clamp(thrust_mps2 - kept_mps2, 0.0f, thrust_mps2) * cfg->motor_lag_s;
    const float late_mps = 2.0f * v_close_mps + more_mps - twice_brake_mps2 * cfg->motor_lag_s;
    const float braked_m = (v_close_mps * v_close_mps + more_mps * ((late_mps > 0.0f) ? late_mps : 0.0f)) / twice_brake_mps2;
    return braked_m + v_close_mps * surface->late_s;
}

void ivl_level_out_prepare(ivl_state_t *state)
{
    state->level = (ivl_level_t){.rises = true, .h_m = state->sense.rel.height_m};
    state->decision = (ivl_decision_t){.room_m = IVL_SENSE_P_M_MAX};
}

// part of the path's direction towards the surface
static float towards(const ivl_state_t *state)
{
    const ivl_surface_t *surface = &state->derived.surface;
    return surface->sin * state->approach.dir_x + surface->cos * state->approach.dir_z;
}

void ivl_level_out_ask(const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_seen_t *seen)
{
    ivl_decision_t      *decision = &state->decision;
    const ivl_ceiling_t *ceiling = &seen->ceiling;
    const float          dt_s = state->derived.dt_s, a_mps2 = state->approach.accel_mps2 * towards(state);
    if (seen->cues.valid)
    {
        // what is seen may be old, and the motors act after the next tick
        const float late_s = dt_s + (ivl_distance_is_present(cfg) ? 0.0f : ceiling->age_s);
        decision->v_close_mps = ceiling->v_close_mps;
        decision->room_m = ceiling->d_ceil_m - ceiling->v_close_mps * late_s - cfg->d_touch_m - cfg->level_margin_m;
        decision->sure_m = SURE_SIGMAS * ceiling->d_sigma_m;
    }
    else
    {
        decision->room_m -= decision->v_close_mps * dt_s;
        decision->v_close_mps += a_mps2 * dt_s;
    }
    const float v_mps = decision->v_close_mps;
    const float left_m = decision->room_m - ivl_level_out_rise_m(cfg, &state->derived.surface, v_mps, cfg->gravity_mps2 + a_mps2);
    const bool  is_last = !(left_m > decision->sure_m);
    // there may be a way back, or there is nothing to flip by
    const bool is_open = !decision->made || (left_m > 0.0f) || !seen->cues.valid;
    // a policy says nothing while the ceiling does not come closer
    decision->asked = (v_mps > 0.0f) && is_open && (state->action.flip || is_last);
}

// the highest point: from here along the surface with what speed there is, until it is braked away
static void turn(const ivl_cfg_t *cfg, ivl_state_t *state)
{
    const ivl_sense_t *sense = &state->sense;
    ivl_level_t       *level = &state->level;
    level->rises = false;
    level->along_mps = sense->rel.along_mps;
    level->vy_mps = sense->sample.v_WB_mps.y;
    state->p_hold_W_m = sense->sample.p_WB_m;
    // where there is not room for both, in the middle between highest point and fence
    const ivl_surface_t *surface = &state->derived.surface;
    const float          z_m = (surface->cos < 0.0f) ? cfg->fence_z_m_max : cfg->fence_z_m_min;
    const float          far_m = surface->sin * cfg->fence_x_m_min + surface->cos * z_m;
    const float          h_m = sense->rel.height_m, half_m = 0.5f * (h_m - far_m), off_m = (half_m < DROP_M) ? half_m : DROP_M;
    level->h_m = ivl_clamp(level->h_m, far_m + off_m, h_m - off_m);
}

// No error of position or velocity is left to the controller: it keeps the vehicle level below a ceiling, with the least thrust that it has; before
// another surface it tilts the vehicle back, or pushes.
static ivl_reference_t rise(const ivl_surface_t *surface, const ivl_sample_t *sample)
{
    return (ivl_reference_t){
        .p_W_m = sample->p_WB_m,
        .v_W_mps = sample->v_WB_mps,
        .a_W_mps2 = ivl_surface_vec3(surface, 0.0f, 0.0f, surface->brake_mps2),
    };
}

static bool retreats(const ivl_state_t *state)
{
    const ivl_surface_t *surface = &state->derived.surface;
    return surface->sin * state->p_hold_W_m.x + surface->cos * state->p_hold_W_m.z > state->level.h_m;
}

// along the surface the speed falls by a constant acceleration, its direction stays
static ivl_reference_t brake(const ivl_cfg_t *cfg, ivl_state_t *state)
{
    ivl_level_t          *level = &state->level;
    const ivl_surface_t  *surface = &state->derived.surface;
    const float           dt_s = state->derived.dt_s, along = level->along_mps, vy = level->vy_mps;
    const float           speed_mps = sqrtf(along * along + vy * vy), dv_mps = cfg->approach_accel_mps2 * dt_s;
    const float           lost = (speed_mps > dv_mps) ? dv_mps / speed_mps : 1.0f;
    const float           back_mps = retreats(state) ? RETREAT_MPS : 0.0f;
    const ivl_reference_t ref = {
        .p_W_m = state->p_hold_W_m,
        .v_W_mps = ivl_surface_vec3(surface, along, vy, back_mps),
        .a_W_mps2 = ivl_surface_vec3(surface, -lost * along * cfg->tick_hz, -lost * vy * cfg->tick_hz, 0.0f),
    };
    const float mean = 1.0f - 0.5f * lost;
    state->p_hold_W_m = ivl_add(state->p_hold_W_m, ivl_surface_vec3(surface, mean * along * dt_s, mean * vy * dt_s, back_mps * dt_s));
    level->along_mps = along - lost * along;
    level->vy_mps = vy - lost * vy;
    level->rest_s += ivl_level_out_rests(state) ? dt_s : 0.0f;
    return ref;
}

ivl_reference_t ivl_level_out_next(const ivl_cfg_t *cfg, ivl_state_t *state)
{
    const ivl_sense_t *sense = &state->sense;
    if (state->level.rises && !(sense->rel.close_mps > 0.0f))
    {
        turn(cfg, state);
    }
    return state->level.rises ? rise(&state->derived.surface, &sense->sample) : brake(cfg, state);
}

bool ivl_level_out_rests(const ivl_state_t *state)
{
    const ivl_level_t *level = &state->level;
    return !level->rises && !(fabsf(level->along_mps) + fabsf(level->vy_mps) > 0.0f) && !retreats(state);
}
