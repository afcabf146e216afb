/// @file ivl_cfg_name.h
/// Names of the parameters, for messages.  A header, so that only who prints them carries them.
#ifndef IVL_CFG_NAME_H
#define IVL_CFG_NAME_H
#include <stddef.h>

#include "ivl_cfg.h"

/// Name of a row of IVL_PARAMS, for example "kp_pos_xy"; NULL for a number that is none.  Static storage.
static inline const char *ivl_cfg_name(int row)
{
#define IVL_CFG_NAME(ctype, group, name, field, unit, min, max, dflt, doc) name,
    static const char *const names[] = {IVL_PARAMS(IVL_CFG_NAME)};
    return ((row >= 0) && ((size_t)row < sizeof names / sizeof names[0])) ? names[row] : NULL;
}

/// Name of the first parameter that ivl_cfg_check refuses, NULL if all are good.
static inline const char *ivl_cfg_bad_name(const ivl_cfg_t *cfg)
{
    return ivl_cfg_name(ivl_cfg_bad_row(cfg));
}
#endif  // IVL_CFG_NAME_H
