/// @file ivl_landing.c
#include "ivl_landing.h"

#include "ivl_level_out.h"

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
        ref.v_W_mps.x = state->derived.surface.aside * cfg->land_speed_mps;
        ref.v_W_mps.z = -cfg->land_speed_mps;
        hold->x += ref.v_W_mps.x * dt_s;
        hold->z -= cfg->land_speed_mps * dt_s;
    }
    else
    {
        state->landed_s += dt_s;
    }
    return ref;
}
