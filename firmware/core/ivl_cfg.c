/// @file ivl_cfg.c
#include "ivl_cfg.h"

#include <string.h>

#include "ivl_pwm.h"
#include "ivl_wire.h"

#define ROW(ctype, group, name, field, unit, min, max, dflt, doc)     ROW_##field,
#define RANGE(ctype, group, name, field, unit, min, max, dflt, doc)   {(float)(min), (float)(max)},
#define DEFAULT(ctype, group, name, field, unit, min, max, dflt, doc) .field = (ctype)(dflt),
#define PLACE(ctype, group, name, field, unit, min, max, dflt, doc)   {offsetof(ivl_cfg_t, field), sizeof(ctype)},

enum
{
    IVL_PARAMS(ROW) ROW_COUNT
};

// a member of one byte is a uint8_t, one of four a float; both numbers in two bytes
typedef struct
{
    uint16_t offset : 13;
    uint16_t size : 3;
} place_t;

typedef struct
{
    float min, max;
} range_t;

static const place_t PLACES[] = {IVL_PARAMS(PLACE)};
static const range_t RANGES[] = {IVL_PARAMS(RANGE)};

static const ivl_cfg_t DEFAULTS = {IVL_PARAMS(DEFAULT)};

static float get(const ivl_cfg_t *cfg, int row)
{
    const uint8_t *at = (const uint8_t *)cfg + PLACES[row].offset;
    float          value = (float)*at;
    if (PLACES[row].size == sizeof value)
    {
        memcpy(&value, at, sizeof value);
    }
    return value;
}

void ivl_cfg_defaults(ivl_cfg_t *cfg)
{
    *cfg = DEFAULTS;
}

static int bad_range(const ivl_cfg_t *cfg)
{
    for (int row = 0; row < (int)ROW_COUNT; row++)
    {
        // in positive form, so that NaN is refused
        const float value = get(cfg, row);
        if (!((value >= RANGES[row].min) && (value <= RANGES[row].max)))
        {
            return row;
        }
    }
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

ivl_status_t ivl_cfg_check(const ivl_cfg_t *cfg)
{
    return (ivl_cfg_bad_row(cfg) < 0) ? IVL_OK : IVL_ERR_RANGE;
}

uint32_t ivl_cfg_crc(const ivl_cfg_t *cfg)
{
    uint32_t crc = 0;
    for (int row = 0; row < (int)ROW_COUNT; row++)
    {
        crc = ivl_wire_crc(crc, (const uint8_t *)cfg + PLACES[row].offset, PLACES[row].size);
    }
    return crc;
}
