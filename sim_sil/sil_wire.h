/// @file sil_wire.h
/// What vehicle and host tell each other, described to other languages by the same rows as sil.h: packets of the app channel, flight recorder,
/// configuration and log variables.  Nothing of it is written down a second time.
#ifndef IVL_SIL_WIRE_H
#define IVL_SIL_WIRE_H

#include "sil.h"

/// Packets have their own type as number (ivl_wire.h); these follow behind them.
enum
{
    IVL_SIL_LAYOUT_RECORD_HEADER = 0x100,  ///< of the flight recorder
    IVL_SIL_LAYOUT_RECORD_ROW = 0x101,     ///< `dflt` is the number of counts for one `unit`
    IVL_SIL_LAYOUT_CONFIG = 0x102,         ///< ivl_cfg_t: names "group.name" of the vehicle's parameters, with their ranges and defaults
    IVL_SIL_LAYOUT_LOGS = 0x103            ///< names and types of the vehicle's log variables; no record, offsets are 0
};

/// Fields of a packet or record, NULL if there is none with that number.  A packet begins with its type and version, one byte each.
const ivl_sil_field_t *ivl_sil_layout(int code, uint32_t *n_fields, uint32_t *item_size);

/// Version that the second byte of each packet has.
int ivl_sil_wire_version(void);

/// The flight core's configuration of a model.
/// @param[out] config  laid out as IVL_SIL_LAYOUT_CONFIG says
/// @return its CRC-32, as a vehicle computes it
uint32_t ivl_sil_model_config(const void *model, void *config);

/// Lower-case name of a safety rule, "?" for a number that is none.
const char *ivl_sil_rule_name(int code);

/// 1: a flight that this rule ended says nothing about its policy.  0: its outcome counts.  -1: there is no such rule.
int ivl_sil_rule_discards(int code);

#endif  // IVL_SIL_WIRE_H
