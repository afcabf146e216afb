/// @file ivl_cfg.c
#include "ivl_cfg.h"

#include "ivl_pwm.h"

#define SET_DEFAULT(ctype, group, name, field, unit, min, max, dflt, doc) cfg->field = (ctype)(dflt);

void ivl_cfg_defaults(ivl_cfg_t *cfg)
{
    IVL_PARAMS(SET_DEFAULT);
}

// one comparison per row of the table, in positive form so that NaN is refused
#define REFUSE_OUTSIDE(ctype, group, name, field, unit, min, max, dflt, doc)                                                               \
    if (!(((float)cfg->field >= (float)(min)) && ((float)cfg->field <= (float)(max))))                                                     \
    {                                                                                                                                      \
        return name;                                                                                                                       \
    }

static const char *bad_range(const ivl_cfg_t *cfg)
{
    IVL_PARAMS(REFUSE_OUTSIDE)
    return NULL;
}

static const char *bad_fence(const ivl_cfg_t *cfg)
{
    if (!(cfg->fence_x_m_min < cfg->fence_x_m_max))
    {
        return "fence_x_min";
    }
    if (!(cfg->fence_y_m_min < cfg->fence_y_m_max))
    {
        return "fence_y_min";
    }
    return (cfg->fence_z_m_min < cfg->fence_z_m_max) ? NULL : "fence_z_min";
}

const char *ivl_cfg_bad_name(const ivl_cfg_t *cfg)
{
    const char *bad = bad_range(cfg);
    if (bad != NULL)
    {
        return bad;
    }
    // members that have to fit each other
    if (!(cfg->d_ceil_m_min < cfg->d_ceil_m_max))
    {
        return "d_ceil_min";
    }
    if (!(cfg->speed_mps_min < cfg->speed_mps_max))
    {
        return "speed_min";
    }
    if (!(4.0f * cfg->motor_thrust_N_max > cfg->mass_kg * cfg->gravity_mps2))
    {
        return "motor_thrust_max";
    }
    const char *fence = bad_fence(cfg);
    if (fence != NULL)
    {
        return fence;
    }
    return ivl_pwm_curve_good(cfg) ? NULL : "pwm_c";
}

ivl_status_t ivl_cfg_check(const ivl_cfg_t *cfg)
{
    return (ivl_cfg_bad_name(cfg) == NULL) ? IVL_OK : IVL_ERR_RANGE;
}
