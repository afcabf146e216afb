/// @file ivl_cfg.h
/// Configuration of the core: one member per row of IVL_PARAMS, in that order.  Constant from ivl_init on.
#ifndef IVL_CFG_H
#define IVL_CFG_H
#include "ivl_types.h"
#include "ivl_vars.h"

#define IVL_CFG_MEMBER(ctype, group, name, field, unit, min, max, dflt, doc) ctype field;
typedef struct
{
    IVL_PARAMS(IVL_CFG_MEMBER)
} ivl_cfg_t;

/// Fill a configuration with the defaults of IVL_PARAMS.
void ivl_cfg_defaults(ivl_cfg_t *cfg);

/// Check every range of IVL_PARAMS (NaN is refused), and that the members fit each other: d_ceil_min < d_ceil_max, speed_min < speed_max,
/// the fence has an inside, four motors can lift the weight, the thrust curve is finite up to the largest thrust, shape REGION goes with a ceiling.
/// @return IVL_OK or IVL_ERR_RANGE
ivl_status_t ivl_cfg_check(const ivl_cfg_t *cfg);

/// Row of IVL_PARAMS of the first parameter that ivl_cfg_check refuses, -1 if all are good.
int ivl_cfg_bad_row(const ivl_cfg_t *cfg);

/// CRC-32 over the members in the order of IVL_PARAMS, little-endian, without padding: what a host compares with its own.
uint32_t ivl_cfg_crc(const ivl_cfg_t *cfg);
#endif  // IVL_CFG_H
