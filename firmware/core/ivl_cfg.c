/// @file ivl_cfg.c
#include "ivl_cfg.h"

#include <string.h>

#include "ivl_pwm.h"
#include "ivl_wire.h"

#define ROW(ctype, group, name, field, unit, min, max, dflt, doc)     ROW_##field,
#define RANGE(ctype, group, name, field, unit, min, max, dflt, doc)   {(float)(min), (float)(max)},
#define DEFAULT(ctype, group, name, field, unit, min, max, dflt, doc) .field = (ctype)(dflt),
#define SIZE(ctype, group, name, field, unit, min, max, dflt, doc)    sizeof(ctype),

enum
{
    IVL_PARAMS(ROW) ROW_COUNT
};

typedef struct
{
    float min, max;
} range_t;

// a member of one byte is a uint8_t, one of four a float
static const uint8_t SIZES[] = {IVL_PARAMS(SIZE)};
static const range_t RANGES[] = {IVL_PARAMS(RANGE)};

static const ivl_cfg_t DEFAULTS = {IVL_PARAMS(DEFAULT)};

// where a member of this size stands that follows those up to `end`: at the next multiple of its size
static const uint8_t *next(const uint8_t *end, size_t size)
{
    return end + (size - (uintptr_t)end % size) % size;
}

static float get(const uint8_t *at, size_t size)
{
    float value = (float)*at;
    if (size == sizeof value)
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
    const uint8_t *at = (const uint8_t *)cfg;
    for (int row = 0; row < (int)ROW_COUNT; at += SIZES[row], row++)
    {
        at = next(at, SIZES[row]);
        // in positive form, so that NaN is refused
        const float value = get(at, SIZES[row]);
        if (!((value >= RANGES[row].min) && (value <= RANGES[row].max)))
        {
            return row;
        }
    }
    return -1;
}

// pairs of which the first has to be less than the second; the first is the one that is named
#define PAIR(lo, hi) {offsetof(ivl_cfg_t, lo), offsetof(ivl_cfg_t, hi), ROW_##lo}
static const struct
{
    uint16_t lo, hi;
    uint8_t  row;
} PAIRS[] = {
    PAIR(d_ceil_m_min, d_ceil_m_max),   PAIR(speed_mps_min, speed_mps_max), PAIR(fence_x_m_min, fence_x_m_max),
    PAIR(fence_y_m_min, fence_y_m_max), PAIR(fence_z_m_min, fence_z_m_max),
};

// members that have to fit each other
static int bad_match(const ivl_cfg_t *cfg)
{
    const uint8_t *members = (const uint8_t *)cfg;
    for (size_t i = 0; i < sizeof PAIRS / sizeof PAIRS[0]; i++)
    {
        if (!(get(members + PAIRS[i].lo, sizeof(float)) < get(members + PAIRS[i].hi, sizeof(float))))
        {
            return PAIRS[i].row;
        }
    }
    // the region of the approach is one below a ceiling
    if ((cfg->shape == 3u) && (cfg->surface_tilt_rad > 0.0f))
    {
        return ROW_surface_tilt_rad;
    }
    if (!(4.0f * cfg->motor_thrust_N_max > cfg->mass_kg * cfg->gravity_mps2))
    {
        return ROW_motor_thrust_N_max;
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
    const uint8_t *at = (const uint8_t *)cfg;
    uint32_t       crc = 0;
    for (int row = 0; row < (int)ROW_COUNT; at += SIZES[row], row++)
    {
        at = next(at, SIZES[row]);
        crc = ivl_wire_crc(crc, at, SIZES[row]);
    }
    return crc;
}
