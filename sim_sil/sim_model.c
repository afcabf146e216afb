#include "sim_model.h"
#include "ivl_cfg_name.h"
#include "ivl_controller.h"

#include <stdio.h>

#include "world_reading.h"
#include "world_step_size.h"

typedef struct
{
    const char *name, *unit;
    double      lo, hi;
} range_t;

#define RANGE(group, name, suffix, unit, lo, hi, dflt, doc) {#group "." #name, unit, lo, hi},
static const range_t RANGES[] = {IVL_SIM_PARAMS(RANGE)};
#undef RANGE

static bool in_range(const ivl_sim_params_t *raw, char *error, size_t error_size)
{
    const double *value = (const double *)raw;
    for (size_t i = 0; i < sizeof RANGES / sizeof RANGES[0]; i++)
    {
        const range_t *r = &RANGES[i];
        // positive form: NaN is refused
        if (!(value[i] >= r->lo && value[i] <= r->hi))
        {
            snprintf(error, error_size, "%s: %g is outside the allowed range %g .. %g %s", r->name, value[i], r->lo, r->hi, r->unit);
            return false;
        }
    }
    return true;
}

/// Motors and legs stand at azimuth -45, -135, 135, 45 degrees: 1 front-right, 2 rear-right, 3 rear-left, 4 front-left.
static const double SIGN_X[4] = {1.0, -1.0, -1.0, 1.0};
static const double SIGN_Y[4] = {-1.0, -1.0, 1.0, 1.0};
/// Reaction torque on the body: motors 1 and 3 turn one way, 2 and 4 the other.
static const double SPIN[4] = {-1.0, 1.0, -1.0, 1.0};

static void derive_legs(ivl_sim_model_t *model)
{
    const ivl_sim_params_t *raw = &model->raw;
    ivl_sim_leg_model_t    *leg = &model->leg;
    double                  sin_psi, cos_psi;
    ivl_sim_sincos(raw->leg_angle_deg * (IVL_SIM_PI / 180.0), &sin_psi, &cos_psi);
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        // outward direction of the leg's vertical plane
        const double ox = SIGN_X[i] * sqrt(0.5), oy = SIGN_Y[i] * sqrt(0.5);
        leg->hip_B_m[i] = ivl_d3(SIGN_X[i] * raw->leg_hip_xy_m, SIGN_Y[i] * raw->leg_hip_xy_m, raw->leg_hip_z_m);
        leg->rest_B[i] = ivl_d3(sin_psi * ox, sin_psi * oy, -cos_psi);
        leg->inplane_B[i] = ivl_d3(cos_psi * ox, cos_psi * oy, sin_psi);
        leg->sideways_B[i] = ivl_d3(-oy, ox, 0.0);
    }
    leg->mass_hip_kg = raw->leg_mass_kg / 3.0;
    leg->mass_cross_kg = raw->leg_mass_kg / 6.0;
    leg->mass_foot_kg = raw->leg_mass_kg / 3.0 + raw->leg_foot_mass_kg;
    leg->weight_hip_kg = raw->leg_mass_kg / 2.0;
    leg->weight_foot_kg = raw->leg_mass_kg / 2.0 + raw->leg_foot_mass_kg;
    leg->moment_pivot_kgm2 = leg->mass_foot_kg * raw->leg_length_m * raw->leg_length_m;
    model->leg_frequency_radps = sqrt(raw->leg_stiffness_Nmprad / leg->moment_pivot_kgm2);
    model->leg_damping_ratio = (raw->leg_stiffness_Nmprad > 0.0)
                                   ? raw->leg_damping_Nmsprad / (2.0 * sqrt(raw->leg_stiffness_Nmprad * leg->moment_pivot_kgm2))
                                   : 0.0;
}

/// Simpson's rule over a step of 2 ms of a decay that is not slower than this is good to 1e-6.
static const double SLOW_TAU_S = 0.01;

static void derive_plate(ivl_sim_plate_t *plate, double size_x, double size_y, double size_z, double center_z)
{
    plate->half_m[0] = 0.5 * size_x;
    plate->half_m[1] = 0.5 * size_y;
    plate->half_m[2] = 0.5 * size_z;
    plate->center_z_m = center_z;
    for (int i = 0; i < IVL_SIM_CORNERS; i++)
    {
        plate->corner_B_m[i] = ivl_d3((i & 1) ? plate->half_m[0] : -plate->half_m[0], (i & 2) ? plate->half_m[1] : -plate->half_m[1],
                                      center_z + ((i & 4) ? plate->half_m[2] : -plate->half_m[2]));
    }
}

static double reach(const ivl_sim_model_t *model)
{
    const ivl_d3_t hip = model->leg.hip_B_m[0];
    double         farthest = sqrt(ivl_d3_dot(hip, hip)) + model->raw.leg_length_m + model->raw.leg_foot_radius_m;
    for (int p = 0; p < IVL_SIM_PLATES; p++)
    {
        for (int i = 0; i < IVL_SIM_CORNERS; i++)
        {
            const ivl_d3_t corner = model->plate[p].corner_B_m[i];
            const double   distance = sqrt(ivl_d3_dot(corner, corner));
            farthest = (distance > farthest) ? distance : farthest;
        }
    }
    return farthest;
}

/// Butterworth by the bilinear transform.                                                             [MODEL eq. 13.17]
/// @return false if the corner is not below half the rate
static bool derive_lowpass(double cutoff_hz, double rate_hz, ivl_sim_lowpass_t *filter)
{
    filter->on = isfinite(cutoff_hz);
    if (!filter->on)
    {
        return true;
    }
    if (!(cutoff_hz < 0.5 * rate_hz))
    {
        return false;
    }
    double s, c;
    ivl_sim_sincos(IVL_SIM_PI * cutoff_hz / rate_hz, &s, &c);
    const double k = s / c, norm = 1.0 / (1.0 + sqrt(2.0) * k + k * k);
    filter->b[0] = k * k * norm;
    filter->b[1] = 2.0 * filter->b[0];
    filter->b[2] = filter->b[0];
    filter->a[0] = 2.0 * (k * k - 1.0) * norm;
    filter->a[1] = (1.0 - sqrt(2.0) * k + k * k) * norm;
    return true;
}

/// Height of the highest part of a level vehicle above its origin.
static double top_m(const ivl_sim_model_t *model)
{
    double top = 0.0;
    for (int p = 0; p < IVL_SIM_PLATES; p++)
    {
        const double plate = model->plate[p].center_z_m + model->plate[p].half_m[2];
        top = (plate > top) ? plate : top;
    }
    return top;
}

/// Excess of the square of the speed over its end, for each step of the speed's excess, while a rotor slows down.   [MODEL eq. 2.9, 14.6]
static double excess_per_step(const ivl_sim_model_t *model, double excess, double end)
{
    const double share = model->raw.rotor_drag_share_norm, full = model->rotor_speed_max_radps;
    return (excess + 2.0 * end) * model->raw.rotor_tau_down_s / (1.0 - share + share * (2.0 * end + excess) / full);
}

/// Time constant of an exponential that has the impulse of the thrust that fades from hover to the least lift.  By Simpson's rule over the speed.
static double thrust_lag_s(const ivl_sim_model_t *model)
{
    const double kept = (double)IVL_LIFT_NORM_MIN, hover = model->rotor_speed_hover_radps, end = sqrt(kept) * hover;
    const double whole = hover - end, sum = excess_per_step(model, 0.0, end) + 4.0 * excess_per_step(model, 0.5 * whole, end) +
                                            excess_per_step(model, whole, end);
    return whole / 6.0 * sum / (hover * hover * (1.0 - kept));
}

/// Of the surface's normal, from up to x.
static double tilt_rad(const ivl_sim_params_t *raw)
{
    return (180.0 - raw->surface_angle_deg) * (IVL_SIM_PI / 180.0);
}

/// A source that knows where the surface is, or takes the vehicle's own speed for the closing speed, is wrong of one that moves.
static bool sees_motion(const ivl_sim_params_t *raw, const ivl_cfg_t *cfg, char *error, size_t error_size)
{
    const bool moves = fabs(raw->surface_speed_away_mps) + fabs(raw->surface_speed_along_mps) > 0.0;
    const bool relative = cfg->d_source == (uint8_t)IVL_SOURCE_FILTER || cfg->d_source == (uint8_t)IVL_SOURCE_FORMULA;
    if (moves && !relative)
    {
        snprintf(error, error_size,
                 "surface.speed_along, surface.speed_away: %g and %g m/s: firmware.d_source %d does not see a surface move (1 and 2 do)",
                 raw->surface_speed_along_mps, raw->surface_speed_away_mps, (int)cfg->d_source);
        return false;
    }
    if (fabs(raw->surface_speed_along_mps) > 0.0 && cfg->of_source == 0u)
    {
        snprintf(error, error_size, "surface.speed_along: %g m/s: firmware.of_source 0 does not see it (1 does, with a flow sensor)",
                 raw->surface_speed_along_mps);
        return false;
    }
    return true;
}

/// The flight core knows the vehicle that it flies: its copy of these numbers follows from the world's.
static void tell_firmware(ivl_sim_model_t *model)
{
    const ivl_sim_params_t *raw = &model->raw;
    ivl_cfg_t              *cfg = &model->firmware;
    cfg->mass_kg = (float)model->mass_total_kg;
    cfg->jxx_kgm2 = (float)raw->body_inertia_xx_kgm2;
    cfg->jyy_kgm2 = (float)raw->body_inertia_yy_kgm2;
    cfg->jzz_kgm2 = (float)raw->body_inertia_zz_kgm2;
    cfg->gravity_mps2 = (float)raw->world_gravity_mps2;
    cfg->arm_x_m = (float)raw->rotor_x_m;
    cfg->arm_y_m = (float)raw->rotor_y_m;
    cfg->torque_per_thrust_m = (float)raw->rotor_torque_constant_m;
    cfg->motor_thrust_N_max = (float)raw->rotor_thrust_max_N;
    cfg->motor_lag_s = (float)thrust_lag_s(model);
    // 0 tells that the supply never sags
    cfg->vbat_V_rated = (raw->battery_voltage_V > 0.0) ? (float)raw->battery_rated_voltage_V : 0.0f;
    cfg->d_touch_m = (float)(top_m(model) + raw->world_sensed_gap_offset_m);
    cfg->h_ceil_m = (float)(ivl_sim_surface_height(&model->surface, 0.0) + raw->world_sensed_gap_offset_m);
    cfg->surface_tilt_rad = (float)tilt_rad(raw);
}

/// A camera that is rendered takes one picture a tick at the most, and is the only one that tells RREV and flow.
static bool camera_possible(const ivl_sim_model_t *model, char *error, size_t error_size)
{
    const ivl_sim_params_t *raw = &model->raw;
    const double            tick_hz = (double)model->firmware.tick_hz;
    if (raw->camera_rate_hz > 0.0 && (raw->rrev_rate_hz > 0.0 || raw->flow_rate_hz > 0.0))
    {
        snprintf(error, error_size, "camera.rate: %g: goes with neither rrev.rate nor flow.rate, which stand for a camera themselves",
                 raw->camera_rate_hz);
        return false;
    }
    if (raw->camera_rate_hz > 0.5 * tick_hz)
    {
        snprintf(error, error_size, "camera.rate: %g Hz: must not be above half of firmware.tick_hz, %g Hz", raw->camera_rate_hz, tick_hz);
        return false;
    }
    if ((raw->camera_width_px > 160.0 && raw->camera_width_px < 320.0))
    {
        snprintf(error, error_size, "camera.width: %g px: must be 160 or 320", raw->camera_width_px);
        return false;
    }
    return true;
}

bool ivl_sim_model_init(ivl_sim_model_t *model, const ivl_sim_params_t *raw, const ivl_cfg_t *firmware, char *error, size_t error_size)
{
    if (!in_range(raw, error, error_size))
    {
        return false;
    }
    memset(model, 0, sizeof *model);
    model->raw = *raw;
    model->firmware = *firmware;
    model->core = ivl_sim_core_linked;
    model->surface =
        ivl_sim_surface_tilted(raw->world_ceiling_height_m, tilt_rad(raw), raw->surface_speed_along_mps, raw->surface_speed_away_mps);
    model->up_W = ivl_d3(0.0, 0.0, 1.0);
    derive_legs(model);
    derive_plate(&model->plate[IVL_SIM_PROP_PLATE], raw->prop_plate_size_x_m, raw->prop_plate_size_y_m, raw->prop_plate_size_z_m,
                 raw->prop_plate_center_z_m);
    derive_plate(&model->plate[IVL_SIM_BASE_PLATE], raw->base_plate_size_x_m, raw->base_plate_size_y_m, raw->base_plate_size_z_m,
                 raw->base_plate_center_z_m);
    for (int i = 0; i < IVL_SIM_MOTORS; i++)
    {
        model->rotor_x_m[i] = SIGN_X[i] * raw->rotor_x_m;
        model->rotor_y_m[i] = SIGN_Y[i] * raw->rotor_y_m;
        model->rotor_spin[i] = SPIN[i];
    }
    model->mass_total_kg = raw->body_mass_kg + IVL_SIM_LEGS * (raw->leg_mass_kg + raw->leg_foot_mass_kg);
    model->rotor_speed_max_radps = sqrt(raw->rotor_thrust_max_N / raw->rotor_thrust_constant_Ns2);
    model->rotor_speed_hover_radps =
        sqrt(model->mass_total_kg * raw->world_gravity_mps2 / (IVL_SIM_MOTORS * raw->rotor_thrust_constant_Ns2));
    model->reach_m = reach(model);
    tell_firmware(model);
    if (ivl_cfg_check(&model->firmware) != IVL_OK)
    {
        const char *name = ivl_cfg_bad_name(&model->firmware);
        snprintf(error, error_size, "firmware.%s: refused by the flight core: out of range, or at odds with the vehicle",
                 name ? name : "?");
        return false;
    }
    if (!sees_motion(raw, &model->firmware, error, error_size))
    {
        return false;
    }
    if (raw->rotor_drag_share_norm > 0.0 && raw->rotor_tau_down_s < SLOW_TAU_S)
    {
        snprintf(error, error_size, "rotor.drag_share: %g: goes with rotor.tau_down from %g s on, which is %g s",
                 raw->rotor_drag_share_norm, SLOW_TAU_S, raw->rotor_tau_down_s);
        return false;
    }
    model->tick_s = 1.0 / (double)model->firmware.tick_hz;
    if (!camera_possible(model, error, error_size))
    {
        return false;
    }
    model->readings = &ivl_sim_readings;
    model->has_readings = ivl_sim_readings_any(model);
    const double rate = (double)model->firmware.tick_hz;
    if (!derive_lowpass(raw->sense_gyro_cutoff_hz, rate, &model->gyro_lowpass) ||
        !derive_lowpass(raw->sense_accel_cutoff_hz, rate, &model->accel_lowpass))
    {
        snprintf(error, error_size, "sense.gyro_cutoff, sense.accel_cutoff: %g and %g Hz: must be below half of firmware.tick_hz, %g Hz",
                 raw->sense_gyro_cutoff_hz, raw->sense_accel_cutoff_hz, 0.5 * rate);
        return false;
    }
    return ivl_sim_step_derive(model, error, error_size);
}
