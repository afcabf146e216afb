/// @file ivl_landing.c
#include "ivl_landing.h"

#include "ivl_level_out.h"

// straight down; before a slope that the vehicle would come down on, along it.  One that is flatter than 45 degrees is landed on
static ivl_vec3_t down(const ivl_surface_t *surface)
{
    const bool is_steep = (surface->cos < 0.0f) && (surface->sin > -surface->cos);
    return is_steep ? (ivl_vec3_t){surface->cos, 0.0f, -surface->sin} : (ivl_vec3_t){0.0f, 0.0f, -1.0f};
}

ivl_reference_t ivl_landing_next(const ivl_cfg_t *cfg, ivl_state_t *state)
{
    const float     dt_s = state->derived.dt_s;
    ivl_vec3_t     *hold = &state->p_hold_W_m;
    ivl_reference_t ref = {.p_W_m = *hold};

    if (!ivl_level_out_rests(state))
    {
        return ivl_level_out_next(cfg, state);
    }
    if ((float)state->n_phase_tick * dt_s < cfg->abort_hover_s)
    {
        return ref;
    }
    if (hold->z > cfg->land_height_m)
    {
        ref.v_W_mps = ivl_scale(down(&state->derived.surface), cfg->land_speed_mps);
        *hold = ivl_add(*hold, ivl_scale(ref.v_W_mps, dt_s));
    }
    else
    {
        state->landed_s += dt_s;
    }
    return ref;
}
