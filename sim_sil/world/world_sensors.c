#include "world_sensors.h"

#include "world_clock.h"

/// No sensor resolves less than this, in any SI unit; smaller numbers would also be denormal in the core's products, which
/// costs a hundred cycles each on a desktop.
static const double RESOLUTION = 1.0e-9;

static float to_float(double a)
{
    return (fabs(a) < RESOLUTION) ? 0.0f : (float)a;
}

static ivl_vec3_t to_float3(const double a[3])
{
    return (ivl_vec3_t){to_float(a[0]), to_float(a[1]), to_float(a[2])};
}

static void add_noise(const ivl_sim_rng_t *rng, ivl_sim_draw_t purpose, uint32_t index, double sigma, double a[3])
{
    if (sigma > 0.0)
    {
        double n[4];
        ivl_sim_normal4(rng, purpose, index, n);
        for (int i = 0; i < 3; i++)
        {
            a[i] += sigma * n[i];
        }
    }
}

static void clip(double most, double a[3])
{
    for (int i = 0; i < 3; i++)
    {
        a[i] = (a[i] > most) ? most : ((a[i] < -most) ? -most : a[i]);
    }
}

static void round_to(double resolution, double a[3])
{
    for (int i = 0; i < 3 && resolution > 0.0; i++)
    {
        a[i] = resolution * floor(a[i] / resolution + 0.5);
    }
}

/// Takes the sample that fell due `age_s` ago, from the present state: exact for constant acceleration.
static void take_pose(const ivl_sim_model_t *model, const ivl_sim_rng_t *rng, const ivl_sim_kin_t *state, const double a_W_mps2[3],
                      double age_s, ivl_sim_sensors_t *sensors)
{
    ivl_sim_pose_t *pose = &sensors->queue[sensors->n_taken % IVL_SIM_POSE_QUEUE];
    pose->t_s = sensors->next_s;
    for (int i = 0; i < 3; i++)
    {
        pose->p_W_m[i] = state->p_WB_m[i] - age_s * (state->v_WB_mps[i] - 0.5 * age_s * a_W_mps2[i]);
        pose->v_W_mps[i] = state->v_WB_mps[i] - age_s * a_W_mps2[i];
    }
    add_noise(rng, IVL_SIM_DRAW_POSITION, sensors->n_taken, model->raw.sense_position_noise_m, pose->p_W_m);
    add_noise(rng, IVL_SIM_DRAW_VELOCITY, sensors->n_taken, model->raw.sense_velocity_noise_mps, pose->v_W_mps);
    round_to(model->raw.sense_position_resolution_m, pose->p_W_m);
    // the first one is always there: somebody looked before the start
    pose->lost = model->raw.sense_pose_drop_norm > 0.0 && sensors->n_taken > 0 &&
                 ivl_sim_uniform(rng, IVL_SIM_DRAW_POSE_DROP, sensors->n_taken) < model->raw.sense_pose_drop_norm;
    sensors->n_taken++;
    sensors->next_s += 1.0 / model->raw.sense_pose_rate_hz;
}

static void deliver(const ivl_sim_model_t *model, double t_s, ivl_sim_sensors_t *sensors)
{
    while (sensors->n_delivered != sensors->n_taken)
    {
        const ivl_sim_pose_t *pose = &sensors->queue[sensors->n_delivered % IVL_SIM_POSE_QUEUE];
        if (pose->t_s + model->raw.sense_latency_s > t_s + IVL_SIM_TIME_SLACK_S)
        {
            return;
        }
        if (!pose->lost)
        {
            sensors->held = *pose;
        }
        sensors->n_delivered++;
    }
}

static bool reckons(const ivl_sim_model_t *model)
{
    return model->raw.sense_inertial_norm > 0.5 || model->raw.sense_attitude_integrated_norm > 0.5;
}

void ivl_sim_sensors_init(const ivl_sim_model_t *model, const ivl_sim_rng_t *rng, const ivl_sim_kin_t *state, ivl_sim_sensors_t *sensors)
{
    const double period = 1.0 / model->raw.sense_pose_rate_hz;
    const double phase = model->raw.sense_phase_random_norm * ivl_sim_uniform(rng, IVL_SIM_DRAW_SENSOR_PHASE, 0) * period;
    const double still[3] = {0.0, 0.0, 0.0};
    sensors->n_taken = 0;
    sensors->n_delivered = 0;
    sensors->n_tick = 0;
    // begin early enough that the first sample has been delivered at t = 0
    sensors->next_s = phase - period;
    for (int i = 0; i < IVL_SIM_POSE_QUEUE && sensors->next_s + model->raw.sense_latency_s > 0.0; i++)
    {
        sensors->next_s -= period;
    }
    memcpy(sensors->v_last_W_mps, state->v_WB_mps, sizeof sensors->v_last_W_mps);
    for (int i = 0; i < IVL_SIM_POSE_QUEUE && sensors->next_s <= 0.0; i++)
    {
        take_pose(model, rng, state, still, -sensors->next_s, sensors);
    }
    deliver(model, 0.0, sensors);
    memset(sensors->gyro_bias_radps, 0, sizeof sensors->gyro_bias_radps);
    memset(sensors->accel_bias_mps2, 0, sizeof sensors->accel_bias_mps2);
    add_noise(rng, IVL_SIM_DRAW_GYRO_BIAS, 0, model->raw.sense_gyro_bias_radps, sensors->gyro_bias_radps);
    add_noise(rng, IVL_SIM_DRAW_ACCEL_BIAS, 0, model->raw.sense_accel_bias_mps2, sensors->accel_bias_mps2);
    if (reckons(model))
    {
        ivl_sim_reckoning_start(model, rng, state, &sensors->reckoning);
    }
    if (model->has_readings)
    {
        ivl_sim_readings_init(model, rng, sensors->readings);
    }
}

static void read_attitude(const ivl_sim_model_t *model, const ivl_sim_rng_t *rng, const double q[4], uint32_t tick, ivl_in_t *in)
{
    if (!(model->raw.sense_attitude_noise_rad > 0.0))
    {
        in->q_WB = (ivl_quat_t){to_float(q[0]), to_float(q[1]), to_float(q[2]), to_float(q[3])};
        return;
    }
    double e[3] = {0.0, 0.0, 0.0};
    add_noise(rng, IVL_SIM_DRAW_ATTITUDE, tick, 0.5 * model->raw.sense_attitude_noise_rad, e);
    // q (e, 1), normalised: a small rotation by 2 e in the body's axes
    const double s = 1.0 / sqrt(1.0 + e[0] * e[0] + e[1] * e[1] + e[2] * e[2]);
    in->q_WB.x = to_float(s * (q[0] + q[3] * e[0] + q[1] * e[2] - q[2] * e[1]));
    in->q_WB.y = to_float(s * (q[1] + q[3] * e[1] + q[2] * e[0] - q[0] * e[2]));
    in->q_WB.z = to_float(s * (q[2] + q[3] * e[2] + q[0] * e[1] - q[1] * e[0]));
    in->q_WB.w = to_float(s * (q[3] - q[0] * e[0] - q[1] * e[1] - q[2] * e[2]));
}

/// Mean specific force since the last tick, in the body's axes.
static void specific_force(const ivl_sim_model_t *model, const ivl_sim_kin_t *state, ivl_sim_sensors_t *sensors, double accel[3])
{
    double mean[3];
    ivl_d3_store(mean, ivl_d3_scale(model->raw.world_gravity_mps2, model->up_W));
    for (int i = 0; i < 3 && sensors->n_tick > 0; i++)
    {
        mean[i] += (state->v_WB_mps[i] - sensors->v_last_W_mps[i]) / model->tick_s;
    }
    memcpy(sensors->v_last_W_mps, state->v_WB_mps, sizeof sensors->v_last_W_mps);
    const ivl_rot_t R = ivl_rot_from_quat(state->q_WB);
    ivl_d3_store(accel, ivl_rot_apply_inverse(&R, ivl_d3_load(mean)));
}

static void add(const double bias[3], double a[3])
{
    for (int i = 0; i < 3; i++)
    {
        a[i] += bias[i];
    }
}

static void read_imu(const ivl_sim_model_t *model, const ivl_sim_rng_t *rng, const ivl_sim_kin_t *state, ivl_sim_sensors_t *sensors,
                     double gyro[3], double accel[3])
{
    const ivl_sim_params_t *raw = &model->raw;
    memcpy(gyro, state->w_B_radps, sizeof state->w_B_radps);
    specific_force(model, state, sensors, accel);
    if (sensors->n_tick == 0)
    {
        ivl_sim_lowpass_settle(&model->gyro_lowpass, gyro, &sensors->gyro_lowpass);
        ivl_sim_lowpass_settle(&model->accel_lowpass, accel, &sensors->accel_lowpass);
    }
    ivl_sim_lowpass_apply(&model->gyro_lowpass, &sensors->gyro_lowpass, gyro);
    ivl_sim_lowpass_apply(&model->accel_lowpass, &sensors->accel_lowpass, accel);
    add(sensors->gyro_bias_radps, gyro);
    add(sensors->accel_bias_mps2, accel);
    add_noise(rng, IVL_SIM_DRAW_GYRO, sensors->n_tick, raw->sense_gyro_noise_radps, gyro);
    add_noise(rng, IVL_SIM_DRAW_ACCEL, sensors->n_tick, raw->sense_accel_noise_mps2, accel);
    clip(raw->sense_gyro_max_radps, gyro);
    clip(raw->sense_accel_max_mps2, accel);
}

/// Replaces what outside sensors would tell by what the vehicle makes of its own.
static void reckon(const ivl_sim_model_t *model, const double accel[3], double t_s, ivl_sim_sensors_t *sensors, ivl_in_t *in)
{
    ivl_sim_reckoning_t *own = &sensors->reckoning;
    if (sensors->n_tick > 0)
    {
        const double q[4] = {(double)in->q_WB.x, (double)in->q_WB.y, (double)in->q_WB.z, (double)in->q_WB.w};
        ivl_sim_reckoning_move(model, q, accel, own);
    }
    in->t_pose_us = ivl_sim_clock_us(t_s);
    in->p_WB_m = to_float3(own->p_W_m);
    in->v_WB_mps = to_float3(own->v_W_mps);
}

void ivl_sim_sensors_read(const ivl_sim_scene_t *scene, const ivl_sim_rng_t *rng, double t_s, ivl_sim_sensors_t *sensors, ivl_in_t *in)
{
    const ivl_sim_model_t *model = scene->model;
    const ivl_sim_kin_t   *state = scene->kin;
    double                 gyro[3], accel[3];
    // a tick brings a few samples; were it more than the queue holds, the rest would wait for the next one
    for (int i = 0; i < IVL_SIM_POSE_QUEUE && sensors->next_s <= t_s + IVL_SIM_TIME_SLACK_S; i++)
    {
        take_pose(model, rng, state, scene->a_W_mps2, t_s - sensors->next_s, sensors);
    }
    deliver(model, t_s, sensors);
    in->t_us = ivl_sim_clock_us(t_s);
    in->t_pose_us = ivl_sim_clock_us(sensors->held.t_s);
    in->p_WB_m = to_float3(sensors->held.p_W_m);
    in->v_WB_mps = to_float3(sensors->held.v_W_mps);
    read_imu(model, rng, state, sensors, gyro, accel);
    in->w_B_radps = to_float3(gyro);
    in->f_B_mps2 = to_float3(accel);
    const bool own_attitude = model->raw.sense_attitude_integrated_norm > 0.5;
    if (own_attitude && sensors->n_tick > 0)
    {
        ivl_sim_reckoning_turn(model, gyro, &sensors->reckoning);
    }
    read_attitude(model, rng, own_attitude ? sensors->reckoning.q_WB : state->q_WB, sensors->n_tick, in);
    if (model->raw.sense_inertial_norm > 0.5)
    {
        reckon(model, accel, t_s, sensors, in);
    }
    if (model->has_readings)
    {
        ivl_sim_readings_read(scene, rng, t_s, sensors->readings, in);
    }
    sensors->n_tick++;
}
