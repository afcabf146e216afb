/// @file ivl_cfg.c
#include "ivl_cfg.h"

#include "ivl_pwm.h"
#include "ivl_wire.h"

#define SET_DEFAULT(ctype, group, name, field, unit, min, max, dflt, doc) cfg->field = (ctype)(dflt);

void ivl_cfg_defaults(ivl_cfg_t *cfg)
{
    IVL_PARAMS(SET_DEFAULT);
}

#define ROW(ctype, group, name, field, unit, min, max, dflt, doc)  ROW_##field,
#define NAME(ctype, group, name, field, unit, min, max, dflt, doc) name,

enum
{
    IVL_PARAMS(ROW) ROW_COUNT
};

static const char *const NAMES[] = {IVL_PARAMS(NAME)};

// one comparison per row of the table, in positive form so that NaN is refused
#define REFUSE_OUTSIDE(ctype, group, name, field, unit, min, max, dflt, doc)                                                               \
    if (!(((float)cfg->field >= (float)(min)) && ((float)cfg->field <= (float)(max))))                                                     \
    {                                                                                                                                      \
        return ROW_##field;                                                                                                                \
    }

static int bad_range(const ivl_cfg_t *cfg)
{
    IVL_PARAMS(REFUSE_OUTSIDE)
    return -1;
}

static int bad_fence(const ivl_cfg_t *cfg)
{
    if (!(cfg->fence_x_m_min < cfg->fence_x_m_max))
    {
        return ROW_fence_x_m_min;
    }
    if (!(cfg->fence_y_m_min < cfg->fence_y_m_max))
    {
        return ROW_fence_y_m_min;
    }
    return (cfg->fence_z_m_min < cfg->fence_z_m_max) ? -1 : ROW_fence_z_m_min;
}

// members that have to fit each other
static int bad_match(const ivl_cfg_t *cfg)
{
    if (!(cfg->d_ceil_m_min < cfg->d_ceil_m_max))
    {
        return ROW_d_ceil_m_min;
    }
    if (!(cfg->speed_mps_min < cfg->speed_mps_max))
    {
        return ROW_speed_mps_min;
    }
    if (!(4.0f * cfg->motor_thrust_N_max > cfg->mass_kg * cfg->gravity_mps2))
    {
        return ROW_motor_thrust_N_max;
    }
    const int fence = bad_fence(cfg);
    if (fence >= 0)
    {
        return fence;
    }
    return ivl_pwm_curve_good(cfg) ? -1 : ROW_pwm_c_gf;
}

int ivl_cfg_bad_row(const ivl_cfg_t *cfg)
{
    const int row = bad_range(cfg);
    return (row >= 0) ? row : bad_match(cfg);
}

const char *ivl_cfg_name(int row)
{
    return ((row >= 0) && (row < (int)ROW_COUNT)) ? NAMES[row] : NULL;
}

const char *ivl_cfg_bad_name(const ivl_cfg_t *cfg)
{
    return ivl_cfg_name(ivl_cfg_bad_row(cfg));
}

ivl_status_t ivl_cfg_check(const ivl_cfg_t *cfg)
{
    return (ivl_cfg_bad_row(cfg) < 0) ? IVL_OK : IVL_ERR_RANGE;
}

#define ADD_TO_CRC(ctype, group, name, field, unit, min, max, dflt, doc) crc = ivl_wire_crc(crc, &cfg->field, sizeof cfg->field);

uint32_t ivl_cfg_crc(const ivl_cfg_t *cfg)
{
    uint32_t crc = 0;
    IVL_PARAMS(ADD_TO_CRC)
    return crc;
}
