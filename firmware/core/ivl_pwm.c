/// @file ivl_pwm.c
#include "ivl_pwm.h"

#include "ivl_math.h"

static const float GF_PER_N = 101.971621f;  // 1000 / 9.80665
static const float CURVE_RAD_MAX = 1.4f;

static float curve_rad(const ivl_cfg_t *cfg, float thrust_N, float rad_per_gf)
{
    return (thrust_N * GF_PER_N - cfg->pwm_b_gf) * rad_per_gf;
}

bool ivl_pwm_curve_good(const ivl_cfg_t *cfg)
{
    // the argument is linear in thrust, so its ends bound it
    const float rad_per_gf = 1.0f / cfg->pwm_c_gf;
    return ivl_within(curve_rad(cfg, 0.0f, rad_per_gf), CURVE_RAD_MAX) &&
           ivl_within(curve_rad(cfg, cfg->motor_thrust_N_max, rad_per_gf), CURVE_RAD_MAX);
}

void ivl_pwm_of_thrust(const ivl_cfg_t *cfg, const float thrust_N[4], uint16_t pwm[4])
{
    const float rad_per_gf = 1.0f / cfg->pwm_c_gf;
    for (int i = 0; i < 4; i++)
    {
        // clamped before the conversion to an integer, which is undefined outside its range
        const float curve = cfg->pwm_a * ivl_tan(curve_rad(cfg, thrust_N[i], rad_per_gf)) + cfg->pwm_d;
        const float value = (thrust_N[i] > 0.0f) ? curve : 0.0f;
        pwm[i] = (uint16_t)ivl_clamp(value, 0.0f, cfg->pwm_max);
    }
}
