#include "phys_state.h"

static void get(const ivl_w3_t *from, int lane, double to[3])
{
    ivl_d3_store(to, ivl_w3_lane(from, lane));
}

static void set(ivl_w3_t *to, int lane, const double from[3])
{
    to->x[lane] = from[0];
    to->y[lane] = from[1];
    to->z[lane] = from[2];
}

void ivl_sim_lane_get(const ivl_sim_state_t *state, int lane, ivl_sim_kin_t *kin)
{
    get(&state->p_WB_m, lane, kin->p_WB_m);
    get(&state->v_WB_mps, lane, kin->v_WB_mps);
    get(&state->w_B_radps, lane, kin->w_B_radps);
    for (int i = 0; i < 4; i++)
    {
        kin->q_WB[i] = state->q_WB[i][lane];
    }
    kin->pitch_rad = state->pitch_rad[lane];
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        get(&state->p_foot_W_m[i], lane, kin->p_foot_W_m[i]);
        get(&state->v_foot_W_mps[i], lane, kin->v_foot_W_mps[i]);
    }
}

void ivl_sim_lane_set(ivl_sim_state_t *state, int lane, const ivl_sim_kin_t *kin)
{
    set(&state->p_WB_m, lane, kin->p_WB_m);
    set(&state->v_WB_mps, lane, kin->v_WB_mps);
    set(&state->w_B_radps, lane, kin->w_B_radps);
    for (int i = 0; i < 4; i++)
    {
        state->q_WB[i][lane] = kin->q_WB[i];
    }
    state->pitch_rad[lane] = kin->pitch_rad;
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        set(&state->p_foot_W_m[i], lane, kin->p_foot_W_m[i]);
        set(&state->v_foot_W_mps[i], lane, kin->v_foot_W_mps[i]);
    }
}

void ivl_sim_lane_spread(ivl_sim_state_t *state, const ivl_sim_kin_t *kin)
{
    for (int lane = 0; lane < IVL_SIM_LANES; lane++)
    {
        ivl_sim_lane_set(state, lane, kin);
    }
}

/// One lane of a struct that is made of wide numbers only, in whatever order.
static void copy_lane(void *to, const void *from, size_t size, int lane)
{
    double       *t = to;
    const double *f = from;
    for (size_t i = (size_t)lane; i < size / sizeof *t; i += IVL_SIM_LANES)
    {
        t[i] = f[i];
    }
}

void ivl_sim_state_lane_copy(ivl_sim_state_t *to, const ivl_sim_state_t *from, int lane)
{
    copy_lane(to, from, sizeof *to, lane);
}

void ivl_sim_rate_lane_copy(ivl_sim_rate_t *to, const ivl_sim_rate_t *from, int lane)
{
    copy_lane(to, from, sizeof *to, lane);
}

void ivl_sim_rate_lane_clear(ivl_sim_rate_t *rate, int lane)
{
    const ivl_sim_rate_t zero = {.pull_N = {{0.0}}};
    copy_lane(rate, &zero, sizeof zero, lane);
}
