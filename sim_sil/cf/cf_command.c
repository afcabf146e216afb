/// @file cf_command.c
/// What an operator sends to the commander, as set-points.
#include "cf_vehicle.h"
#include "ivl_math.h"

static const float RAD_PER_DEG = 0.0174532925f;
static const float THRUST_FULL = 65535.0f;

// of the attitude command: below the lower one motors stay off
static const uint16_t THRUST_MIN = 1000;
static const uint16_t THRUST_MAX_RPYT = 60000;

// what a set-point may ask for, far beyond what the vehicle can do
static const float DEG_MAX = 3600.0f;
static const float CPPM_DEG_MAX = 1.0e6f;  // ends of the sticks are parameters
static const float METRES_MAX = 1000.0f;

// with the position held, the sticks ask for a speed: 30 degrees are 1 m/s
static const float HOLD_MPS_PER_DEG = 1.0f / 30.0f;
static const float STICK_MIDDLE = 32767.0f;
static const float SQRT_HALF = 0.70710678f;
static const float M_PER_MM = 1.0e-3f;

enum
{
    YAW_MODE_PLUS = 1  // flightmode.yawMode: motor 1 is in front
};

// channels of a radio control: pulses in us, and what the ends of roll, pitch and yaw mean
static const float PULSE_MIDDLE = 1500.0f, PULSE_LOW = 1000.0f, PULSE_HALF = 500.0f, PULSE_FULL = 1000.0f;

static bool within(const float *values, int n, float limit)
{
    bool good = true;
    for (int i = 0; i < n; i++)
    {
        good = good && ivl_within(values[i], limit);
    }
    return good;
}

static ivl_vec3_t vec(const float a[3])
{
    return ivl_vec3(a[0], a[1], a[2]);
}

// ---- the present set-point

ivl_cf_setpoint_t ivl_cf_setpoint(const ivl_cf_t *cf)
{
    ivl_cf_setpoint_t sp = cf->commander.setpoint;
    if (cf->supervisor.state == IVL_CF_STATE_LEVEL_OUT)
    {
        sp.xy = IVL_CF_MODE_OFF;
        sp.roll_mode = sp.pitch_mode = IVL_CF_MODE_ABS;
        sp.yaw = IVL_CF_MODE_VELOCITY;
        sp.roll = sp.pitch = sp.yawrate_radps = 0.0f;
    }
    else if (!ivl_cf_supervisor_motors_allowed(&cf->supervisor))
    {
        sp = (ivl_cf_setpoint_t){.t_ms = sp.t_ms};
    }
    return sp;
}

/// A set-point from the radio stops the planner.
static bool set(ivl_cf_t *cf, const ivl_cf_setpoint_t *sp)
{
    if (ivl_cf_commander_set(&cf->commander, sp, IVL_CF_PRIORITY_CRTP, ivl_cf_now_ms(cf)))
    {
        ivl_cf_planner_stop(&cf->planner);
    }
    return true;
}

static void tell_planner(ivl_cf_t *cf)
{
    const ivl_in_t *in = &cf->sensed;
    ivl_cf_planner_tell(&cf->planner, in->p_WB_m, in->v_WB_mps, ivl_cf_yaw_of(in->q_WB));
}

void ivl_cf_relax(ivl_cf_t *cf)
{
    if (ivl_cf_planner_rests(&cf->planner))
    {
        tell_planner(cf);
    }
    ivl_cf_commander_relax(&cf->commander);
}

void ivl_cf_notify_stop(ivl_cf_t *cf, uint32_t remain_ms)
{
    (void)remain_ms;
    ivl_cf_relax(cf);
}

void ivl_cf_plan(ivl_cf_t *cf)
{
    ivl_cf_setpoint_t sp;
    const bool        has_setpoint = ivl_cf_planner_next(&cf->planner, ivl_cf_now_ms(cf), &sp);
    if (ivl_cf_planner_rests(&cf->planner))
    {
        tell_planner(cf);
    }
    if (!has_setpoint)
    {
        return;
    }
    (void)ivl_cf_commander_set(&cf->commander, &sp, IVL_CF_PRIORITY_HIGH_LEVEL, ivl_cf_now_ms(cf));
}

// ---- attitude

/// Pitch arrives with the sign of the firmware's Euler angles, nose up.
static ivl_cf_setpoint_t attitude(float roll_deg, float pitch_deg, float yawrate_degps, float thrust)
{
    return (ivl_cf_setpoint_t){
        .roll_mode = IVL_CF_MODE_ABS,
        .pitch_mode = IVL_CF_MODE_ABS,
        .yaw = IVL_CF_MODE_VELOCITY,
        .roll = roll_deg * RAD_PER_DEG,
        .pitch = -pitch_deg * RAD_PER_DEG,
        .yawrate_radps = yawrate_degps * RAD_PER_DEG,
        .thrust_norm = thrust / THRUST_FULL,
    };
}

static float unlocked_thrust(ivl_cf_t *cf, uint16_t thrust)
{
    if (cf->commander.priority == IVL_CF_PRIORITY_DISABLE)
    {
        cf->commander.thrust_locked = true;
    }
    if (thrust == 0u)
    {
        cf->commander.thrust_locked = false;
    }
    if (cf->commander.thrust_locked || thrust < THRUST_MIN)
    {
        return 0.0f;
    }
    return (float)((thrust < THRUST_MAX_RPYT) ? thrust : THRUST_MAX_RPYT);
}

/// Roll and pitch as sticks: an angle or a rate each, as flightmode.stabMode* says.
static void set_tilt(const ivl_cf_settings_t *mode, ivl_cf_setpoint_t *sp)
{
    sp->roll_mode = (mode->stab_roll != 0u) ? IVL_CF_MODE_ABS : IVL_CF_MODE_VELOCITY;
    sp->pitch_mode = (mode->stab_pitch != 0u) ? IVL_CF_MODE_ABS : IVL_CF_MODE_VELOCITY;
}

/// The legacy rate turns the other way than all others; with motor 1 in front, roll and pitch angles turn by an eighth.
static void set_yaw(const ivl_cf_settings_t *mode, ivl_cf_setpoint_t *sp, float yaw_deg)
{
    if (mode->stab_yaw != 0u)
    {
        sp->yaw = IVL_CF_MODE_ABS;
        sp->yaw_rad = yaw_deg * RAD_PER_DEG;
        return;
    }
    sp->yawrate_radps = -yaw_deg * RAD_PER_DEG;
    if (mode->yaw_mode == YAW_MODE_PLUS)
    {
        const float roll = (sp->roll_mode == IVL_CF_MODE_ABS) ? sp->roll : 0.0f;
        const float pitch = (sp->pitch_mode == IVL_CF_MODE_ABS) ? sp->pitch : 0.0f;
        sp->roll = (sp->roll_mode == IVL_CF_MODE_ABS) ? SQRT_HALF * (roll + pitch) : sp->roll;
        sp->pitch = (sp->pitch_mode == IVL_CF_MODE_ABS) ? SQRT_HALF * (pitch - roll) : sp->pitch;
    }
}

/// A point in the world instead of sticks: metres, and thrust in mm.
static ivl_cf_setpoint_t point_of_sticks(float roll, float pitch, float yaw_deg, uint16_t thrust)
{
    return (ivl_cf_setpoint_t){
        .xy = IVL_CF_MODE_ABS,
        .z = IVL_CF_MODE_ABS,
        .yaw = IVL_CF_MODE_ABS,
        .p_W_m = {-pitch, roll, (float)thrust * M_PER_MM},
        .yaw_rad = yaw_deg * RAD_PER_DEG,
    };
}

bool ivl_cf_set_rpyt(ivl_cf_t *cf, float roll_deg, float pitch_deg, float yaw_deg, uint16_t thrust)
{
    const float              angles[] = {roll_deg, pitch_deg, yaw_deg};
    const ivl_cf_settings_t *mode = &cf->set;
    if (!within(angles, 3, DEG_MAX))
    {
        return false;
    }
    ivl_cf_setpoint_t sp = attitude(roll_deg, pitch_deg, 0.0f, unlocked_thrust(cf, thrust));
    set_tilt(mode, &sp);
    if (mode->alt_hold != 0u)
    {
        sp.thrust_norm = 0.0f;
        sp.z = IVL_CF_MODE_VELOCITY;
        sp.v_mps.z = ((float)thrust - STICK_MIDDLE) / STICK_MIDDLE;
    }
    if (mode->pos_hold != 0u)
    {
        sp.xy = IVL_CF_MODE_VELOCITY;
        sp.v_mps.x = pitch_deg * HOLD_MPS_PER_DEG;
        sp.v_mps.y = roll_deg * HOLD_MPS_PER_DEG;
        sp.roll = sp.pitch = 0.0f;
    }
    else if (mode->pos_set != 0u && thrust != 0u)
    {
        sp = point_of_sticks(roll_deg, pitch_deg, yaw_deg, thrust);
    }
    if (mode->pos_set == 0u)
    {
        set_yaw(mode, &sp, yaw_deg);
    }
    return set(cf, &sp);
}

bool ivl_cf_set_manual(ivl_cf_t *cf, float roll_deg, float pitch_deg, float yawrate_degps, uint16_t thrust, bool rate)
{
    const float       angles[] = {roll_deg, pitch_deg, yawrate_degps};
    ivl_cf_setpoint_t sp = attitude(roll_deg, pitch_deg, yawrate_degps, (float)thrust);
    sp.roll_mode = sp.pitch_mode = rate ? IVL_CF_MODE_VELOCITY : IVL_CF_MODE_ABS;
    return within(angles, 3, DEG_MAX) && set(cf, &sp);
}

bool ivl_cf_set_zdistance(ivl_cf_t *cf, float roll_deg, float pitch_deg, float yawrate_degps, float z_m)
{
    const float       angles[] = {roll_deg, pitch_deg, yawrate_degps};
    ivl_cf_setpoint_t sp = attitude(roll_deg, pitch_deg, yawrate_degps, 0.0f);
    sp.z = IVL_CF_MODE_ABS;
    sp.p_W_m.z = z_m;
    return within(angles, 3, DEG_MAX) && ivl_within(z_m, METRES_MAX) && set(cf, &sp);
}

bool ivl_cf_set_althold(ivl_cf_t *cf, float roll_deg, float pitch_deg, float yawrate_degps, float vz_mps)
{
    const float       angles[] = {roll_deg, pitch_deg, yawrate_degps};
    ivl_cf_setpoint_t sp = attitude(roll_deg, pitch_deg, yawrate_degps, 0.0f);
    sp.z = IVL_CF_MODE_VELOCITY;
    sp.v_mps.z = vz_mps;
    return within(angles, 3, DEG_MAX) && ivl_within(vz_mps, METRES_MAX) && set(cf, &sp);
}

static float stick(uint16_t pulse_us)
{
    return -((float)pulse_us - PULSE_MIDDLE) / PULSE_HALF;
}

bool ivl_cf_set_cppm(ivl_cf_t *cf, const uint16_t pulse_us[4], bool level)
{
    const ivl_cf_cppm_t *scale = &cf->set.cppm;
    const float          roll_deg = stick(pulse_us[0]) * (level ? scale->roll_deg : scale->roll_degps);
    const float          pitch_deg = stick(pulse_us[1]) * (level ? scale->pitch_deg : scale->pitch_degps);
    const float          yawrate_degps = stick(pulse_us[2]) * scale->yaw_degps;
    const float          share = ivl_clamp(((float)pulse_us[3] - PULSE_LOW) / PULSE_FULL, 0.0f, 1.0f);
    const float          angles[] = {roll_deg, pitch_deg, yawrate_degps};
    if (!within(angles, 3, CPPM_DEG_MAX))
    {
        return false;
    }
    ivl_cf_setpoint_t sp = attitude(roll_deg, pitch_deg, yawrate_degps, share * THRUST_FULL);
    sp.roll_mode = sp.pitch_mode = level ? IVL_CF_MODE_ABS : IVL_CF_MODE_VELOCITY;
    return set(cf, &sp);
}

// ---- position and velocity

bool ivl_cf_set_stop(ivl_cf_t *cf)
{
    const ivl_cf_setpoint_t nothing = {.z = IVL_CF_MODE_OFF};
    return set(cf, &nothing);
}

bool ivl_cf_set_velocity(ivl_cf_t *cf, const float v_W_mps[3], float yawrate_degps)
{
    const ivl_cf_setpoint_t sp = {.xy = IVL_CF_MODE_VELOCITY,
                                  .z = IVL_CF_MODE_VELOCITY,
                                  .yaw = IVL_CF_MODE_VELOCITY,
                                  .v_mps = vec(v_W_mps),
                                  .yawrate_radps = yawrate_degps * RAD_PER_DEG};
    return within(v_W_mps, 3, METRES_MAX) && ivl_within(yawrate_degps, DEG_MAX) && set(cf, &sp);
}

bool ivl_cf_set_hover(ivl_cf_t *cf, float vx_B_mps, float vy_B_mps, float yawrate_degps, float z_m)
{
    const float             metres[] = {vx_B_mps, vy_B_mps, z_m};
    const ivl_cf_setpoint_t sp = {.xy = IVL_CF_MODE_VELOCITY,
                                  .z = IVL_CF_MODE_ABS,
                                  .yaw = IVL_CF_MODE_VELOCITY,
                                  .in_body = true,
                                  .p_W_m = {0.0f, 0.0f, z_m},
                                  .v_mps = {vx_B_mps, vy_B_mps, 0.0f},
                                  .yawrate_radps = yawrate_degps * RAD_PER_DEG};
    return within(metres, 3, METRES_MAX) && ivl_within(yawrate_degps, DEG_MAX) && set(cf, &sp);
}

bool ivl_cf_set_position(ivl_cf_t *cf, const float p_W_m[3], float yaw_deg)
{
    const ivl_cf_setpoint_t sp = {
        .xy = IVL_CF_MODE_ABS, .z = IVL_CF_MODE_ABS, .yaw = IVL_CF_MODE_ABS, .p_W_m = vec(p_W_m), .yaw_rad = yaw_deg * RAD_PER_DEG};
    return within(p_W_m, 3, METRES_MAX) && ivl_within(yaw_deg, DEG_MAX) && set(cf, &sp);
}

bool ivl_cf_set_full_state(ivl_cf_t *cf, const float p_W_m[3], const float v_W_mps[3], const float a_W_mps2[3], const float q_WB[4],
                           const float w_B_radps[3])
{
    const bool              good = within(p_W_m, 3, METRES_MAX) && within(v_W_mps, 3, METRES_MAX) && within(a_W_mps2, 3, METRES_MAX) &&
                                   within(q_WB, 4, 2.0f) && within(w_B_radps, 3, METRES_MAX);
    const ivl_quat_t        q = good ? (ivl_quat_t){q_WB[0], q_WB[1], q_WB[2], q_WB[3]} : (ivl_quat_t){0.0f, 0.0f, 0.0f, 1.0f};
    const ivl_cf_setpoint_t sp = {.xy = IVL_CF_MODE_ABS,
                                  .z = IVL_CF_MODE_ABS,
                                  .yaw = IVL_CF_MODE_ABS,
                                  .p_W_m = vec(p_W_m),
                                  .v_mps = vec(v_W_mps),
                                  .a_W_mps2 = vec(a_W_mps2),
                                  .yaw_rad = ivl_cf_yaw_of(q)};
    return good && set(cf, &sp);
}
