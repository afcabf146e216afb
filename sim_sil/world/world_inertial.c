#include "world_inertial.h"

void ivl_sim_lowpass_settle(const ivl_sim_lowpass_t *filter, const double x[3], ivl_sim_lowpass_state_t *state)
{
    for (int i = 0; i < 3; i++)
    {
        state->s2[i] = (filter->b[2] - filter->a[1]) * x[i];
        state->s1[i] = (filter->b[1] - filter->a[0]) * x[i] + state->s2[i];
    }
}

void ivl_sim_lowpass_apply(const ivl_sim_lowpass_t *filter, ivl_sim_lowpass_state_t *state, double x[3])
{
    for (int i = 0; i < 3 && filter->on; i++)
    {
        const double y = filter->b[0] * x[i] + state->s1[i];
        state->s1[i] = filter->b[1] * x[i] - filter->a[0] * y + state->s2[i];
        state->s2[i] = filter->b[2] * x[i] - filter->a[1] * y;
        x[i] = y;
    }
}

/// q (e, 1), normalised: a small rotation by 2 e in the body's axes.
static void turn(double q[4], const double e[3])
{
    const double s = 1.0 / sqrt(1.0 + e[0] * e[0] + e[1] * e[1] + e[2] * e[2]);
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    q[0] = s * (x + w * e[0] + y * e[2] - z * e[1]);
    q[1] = s * (y + w * e[1] + z * e[0] - x * e[2]);
    q[2] = s * (z + w * e[2] + x * e[1] - y * e[0]);
    q[3] = s * (w - x * e[0] - y * e[1] - z * e[2]);
}

static void err(const ivl_sim_rng_t *rng, ivl_sim_draw_t purpose, double sigma, double a[3])
{
    double n[4];
    ivl_sim_normal4(rng, purpose, 0, n);
    for (int i = 0; i < 3; i++)
    {
        a[i] += sigma * n[i];
    }
}

void ivl_sim_reckoning_start(const ivl_sim_model_t *model, const ivl_sim_rng_t *rng, const ivl_sim_kin_t *state,
                             ivl_sim_reckoning_t *reckoning)
{
    double e[3] = {0.0, 0.0, 0.0};
    memcpy(reckoning->q_WB, state->q_WB, sizeof reckoning->q_WB);
    memcpy(reckoning->p_W_m, state->p_WB_m, sizeof reckoning->p_W_m);
    memcpy(reckoning->v_W_mps, state->v_WB_mps, sizeof reckoning->v_W_mps);
    memcpy(reckoning->w_last_B_radps, state->w_B_radps, sizeof reckoning->w_last_B_radps);
    err(rng, IVL_SIM_DRAW_START_ATTITUDE, 0.5 * model->raw.sense_start_attitude_error_rad, e);
    turn(reckoning->q_WB, e);
    err(rng, IVL_SIM_DRAW_START_POSITION, model->raw.sense_start_position_error_m, reckoning->p_W_m);
    err(rng, IVL_SIM_DRAW_START_VELOCITY, model->raw.sense_start_velocity_error_mps, reckoning->v_W_mps);
}

void ivl_sim_reckoning_turn(const ivl_sim_model_t *model, const double w_B_radps[3], ivl_sim_reckoning_t *reckoning)
{
    double e[3];
    for (int i = 0; i < 3; i++)
    {
        // half the mean rate of the tick
        e[i] = 0.25 * model->tick_s * (w_B_radps[i] + reckoning->w_last_B_radps[i]);
        reckoning->w_last_B_radps[i] = w_B_radps[i];
    }
    turn(reckoning->q_WB, e);
}

void ivl_sim_reckoning_move(const ivl_sim_model_t *model, const double q_WB[4], const double f_B_mps2[3], ivl_sim_reckoning_t *reckoning)
{
    const ivl_rot_t R = ivl_rot_from_quat(q_WB);
    double          a[3];
    const ivl_d3_t  weight = ivl_d3_scale(model->raw.world_gravity_mps2, model->up_W);
    ivl_d3_store(a, ivl_d3_sub(ivl_rot_apply(&R, ivl_d3_load(f_B_mps2)), weight));
    for (int i = 0; i < 3; i++)
    {
        reckoning->p_W_m[i] += model->tick_s * (reckoning->v_W_mps[i] + 0.5 * model->tick_s * a[i]);
        reckoning->v_W_mps[i] += model->tick_s * a[i];
    }
}
