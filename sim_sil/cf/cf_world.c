/// @file cf_world.c
/// The world between landings: a floor to start from and to come down to, and the way back to the start point.
#include <math.h>
#include <string.h>

#include "app_convert.h"
#include "cf_vehicle.h"

static const double FLOOR_Z_M = 0.0;

// of the generator's streams, those that no landing is likely to ask for
static const uint64_t STREAM_BETWEEN = 0xFFFFFFFF00000000u;

// No floor and no set of legs is level: half of what a vehicle at rest is tilted by, at least and at most, about both axes.
static const double HALF_TILT_RAD[2] = {0.001, 0.004};

static double half_tilt(const ivl_cf_t *cf, uint32_t axis)
{
    const ivl_sim_rng_t rng = {cf->seed, STREAM_BETWEEN};
    const double        share = 2.0 * ivl_sim_uniform(&rng, IVL_SIM_DRAW_START_ATTITUDE, axis) - 1.0;
    const double        size = HALF_TILT_RAD[0] + (HALF_TILT_RAD[1] - HALF_TILT_RAD[0]) * ((share < 0.0) ? -share : share);
    return (share < 0.0) ? -size : size;
}

/// q, then a small turn about b_x and b_y.
static void tilt(const ivl_cf_t *cf, const double q[4], double out[4])
{
    const double x = half_tilt(cf, 0), y = half_tilt(cf, 1), n = 1.0 / sqrt(1.0 + x * x + y * y);
    out[0] = n * (q[0] + q[3] * x - q[2] * y);
    out[1] = n * (q[1] + q[3] * y + q[2] * x);
    out[2] = n * (q[2] + q[0] * y - q[1] * x);
    out[3] = n * (q[3] - q[0] * x - q[1] * y);
}

static void place_on_floor(ivl_cf_t *cf, double x_m, double y_m, const double q_WB[4])
{
    ivl_sim_kin_t kin;
    memset(&kin, 0, sizeof kin);
    kin.p_WB_m[0] = x_m;
    kin.p_WB_m[1] = y_m;
    kin.p_WB_m[2] = FLOOR_Z_M;
    tilt(cf, q_WB, kin.q_WB);
    ivl_sim_world_rest_legs(&cf->model, &kin);
    ivl_sim_world_place(&cf->group, IVL_CF_LANE, &kin);
    cf->grounded = true;
}

static void start(ivl_cf_t *cf, double z_m)
{
    const double        p[3] = {(double)cf->set.sim.start_x_m, (double)cf->set.sim.start_y_m, z_m}, v[3] = {0.0, 0.0, 0.0};
    const ivl_sim_rng_t rng = {cf->seed, STREAM_BETWEEN + cf->n_reset++};
    cf->zero_us = (cf->t_ms / cf->tick_ms + 1) * cf->tick_ms * 1000u;
    cf->grounded = false;
    ivl_sim_world_start(&cf->group, IVL_CF_LANE, &rng, p, v);
}

static void stop_rotors(ivl_cf_t *cf)
{
    for (int i = 0; i < IVL_SIM_MOTORS; i++)
    {
        cf->group.rotor.speed_radps[i][IVL_CF_LANE] = 0.0;
    }
}

void ivl_cf_world_boot(ivl_cf_t *cf)
{
    const double level[4] = {0.0, 0.0, 0.0, 1.0};
    start(cf, FLOOR_Z_M);
    place_on_floor(cf, (double)cf->set.sim.start_x_m, (double)cf->set.sim.start_y_m, level);
    stop_rotors(cf);
}

void ivl_cf_world_reset(ivl_cf_t *cf)
{
    const uint32_t   now_ms = ivl_cf_now_ms(cf);
    const ivl_vec3_t p = {cf->set.sim.start_x_m, cf->set.sim.start_y_m, cf->set.sim.start_z_m};
    cf->episode.running = false;
    cf->episode.ended = 0;
    start(cf, (double)cf->set.sim.start_z_m);
    ivl_cf_supervisor_fly(&cf->supervisor, now_ms);
    ivl_cf_planner_hover(&cf->planner, p, 0.0f, now_ms);
    ivl_cf_commander_init(&cf->commander);
    ivl_cf_setpoint_t hover;
    (void)ivl_cf_planner_next(&cf->planner, now_ms, &hover);
    (void)ivl_cf_commander_set(&cf->commander, &hover, IVL_CF_PRIORITY_HIGH_LEVEL, now_ms);
    ivl_cf_stock_reset(&cf->stock);
    ivl_cf_estimate_reset(&cf->estimate);
    cf->frame = (ivl_cf_frame_t){.is_other = false};
    ivl_cf_power_full(&cf->power);
    cf->acc_g[0] = cf->acc_g[1] = 0.0f;
    cf->acc_g[2] = (float)cf->model.raw.world_gravity_mps2 / APP_MPS2_PER_G;
    const float hover_N = (float)(cf->model.mass_total_kg * cf->model.raw.world_gravity_mps2 / IVL_SIM_MOTORS);
    app_release(app_norm_of_N(hover_N));
    for (int i = 0; i < 4; i++)
    {
        cf->motor_N[i] = hover_N;
    }
}

void ivl_cf_world_place(ivl_cf_t *cf, bool at_start)
{
    const ivl_sim_kin_t kin = ivl_sim_world_kin(&cf->group, IVL_CF_LANE);
    const ivl_rot_t     R = ivl_rot_from_quat(kin.q_WB);
    double              s, c;
    ivl_sim_sincos(0.5 * ivl_sim_atan2(R.row[1].x, R.row[0].x), &s, &c);
    const double level[4] = {0.0, 0.0, s, c};
    cf->episode.running = false;
    cf->episode.ended = 0;
    start(cf, FLOOR_Z_M);
    place_on_floor(cf, at_start ? (double)cf->set.sim.start_x_m : kin.p_WB_m[0], at_start ? (double)cf->set.sim.start_y_m : kin.p_WB_m[1],
                   level);
    stop_rotors(cf);
    (void)ivl_cf_supervisor_arm(&cf->supervisor, false);
    ivl_cf_planner_stop(&cf->planner);
    ivl_cf_commander_relax(&cf->commander);
    ivl_cf_stock_reset(&cf->stock);
}

// ---- motion

/// It stands on its legs or lies on its back, whichever is nearer, and keeps its heading.
static void come_to_rest(ivl_cf_t *cf)
{
    const ivl_sim_kin_t kin = ivl_sim_world_kin(&cf->group, IVL_CF_LANE);
    const double       *q = kin.q_WB;
    const ivl_rot_t     R = ivl_rot_from_quat(q);
    const bool          upright = R.row[2].z >= 0.0;
    double              s, c;
    ivl_sim_sincos(0.5 * ivl_sim_atan2(R.row[1].x, R.row[0].x), &s, &c);
    // a turn about z, or the same turn after half a turn about x
    const double level[4] = {0.0, 0.0, s, c}, on_back[4] = {c, s, 0.0, 0.0};
    place_on_floor(cf, kin.p_WB_m[0], kin.p_WB_m[1], upright ? level : on_back);
}

static void rest(ivl_cf_t *cf)
{
    ivl_sim_group_t        *group = &cf->group;
    const ivl_sim_kin_t     kin = ivl_sim_world_kin(group, IVL_CF_LANE);
    const ivl_rot_t         R = ivl_rot_from_quat(kin.q_WB);
    const ivl_w3_t          still = ivl_w3_of(ivl_d3(0.0, 0.0, 0.0));
    const ivl_wide_t        tick_s = ivl_wide(cf->model.tick_s);
    const ivl_sim_airflow_t flow = {ivl_wide(ivl_sim_world_gap_m(group, IVL_CF_LANE)), &still, group->state.q_WB};
    ivl_sim_load_t          load;
    ivl_sim_rotor_step(&cf->model, &group->rotor, &flow, &tick_s, &group->rotor, &load);
    group->progress.left_s[IVL_CF_LANE] = 0.0;
    group->progress.restart[IVL_CF_LANE] = -1;
    cf->grounded = !(load.thrust_N[IVL_CF_LANE] * R.row[2].z > cf->model.mass_total_kg * cf->model.raw.world_gravity_mps2);
}

/// The motion that has been due since the last tick.  The world bounds the steps that this takes.
static void move(ivl_cf_t *cf)
{
    if (cf->grounded)
    {
        rest(cf);
        return;
    }
    while (!ivl_sim_world_ready(&cf->group, IVL_CF_LANE))
    {
        ivl_sim_group_step(&cf->group);
    }
}

/// A landing knows no floor: it may begin anywhere below the ceiling.
static void find_floor(ivl_cf_t *cf)
{
    const double level[4] = {0.0, 0.0, 0.0, 1.0};
    if (cf->grounded || cf->episode.running)
    {
        return;
    }
    if (ivl_sim_world_diverged(&cf->group.state, IVL_CF_LANE) || ivl_cf_world(cf)->gave_up)
    {
        place_on_floor(cf, (double)cf->set.sim.start_x_m, (double)cf->set.sim.start_y_m, level);
    }
    else if (cf->group.state.p_WB_m.z[IVL_CF_LANE] <= FLOOR_Z_M && cf->group.state.v_WB_mps.z[IVL_CF_LANE] < 0.0)
    {
        come_to_rest(cf);
    }
}

void ivl_cf_world_tick(ivl_cf_t *cf)
{
    if (ivl_cf_world(cf)->n_tick > 0)
    {
        move(cf);
        ivl_cf_episode_look(cf);
        find_floor(cf);
        ivl_cf_neighbours_tell(cf);
        ivl_cf_neighbours_bump(cf);
    }
    app_start_on_path(cf->set.sim.start != IVL_CF_START_AS_FLOWN);
    const ivl_phase_t before = app_core_state()->phase;
    ivl_sim_world_tick(&cf->group, IVL_CF_LANE);
    const ivl_phase_t after = app_core_state()->phase;
    if (cf->episode.running)
    {
        ivl_sim_rollout_note(&cf->group, IVL_CF_LANE, &cf->episode.now);
    }
    const bool waited = before == IVL_PHASE_IDLE || before == IVL_PHASE_READY;
    if (waited && (after == IVL_PHASE_APPROACH || after == IVL_PHASE_FLIP))
    {
        ivl_cf_episode_begin(cf);
    }
}
