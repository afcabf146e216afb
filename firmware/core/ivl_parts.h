/// @file ivl_parts.h
/// A policy that arrives in parts.  Any part may come late, twice, or not at all; nothing is believed before the whole has its checksum.
/// For the port; the pipeline does not use it.
#ifndef IVL_PARTS_H
#define IVL_PARTS_H
#include "ivl_policy.h"
#include "ivl_wire.h"

typedef struct
{
    ivl_policy_t policy;
    uint16_t     missing;  ///< bit i: part i has not come
    bool         begun;
} ivl_parts_t;

/// Parts that a policy of n parameters travels in.
uint32_t ivl_parts_count(uint32_t n);

/// Take a part.  One with another number, checksum, form or length begins a new policy and forgets the old one.
/// @return IVL_WIRE_OK when parts->policy is whole and its checksum right; IVL_WIRE_ERR_INCOMPLETE; IVL_WIRE_ERR_CRC, and all parts are forgotten;
///         IVL_WIRE_ERR_FORM for a form or length that this vehicle does not have; IVL_WIRE_ERR_RANGE for a part that such a policy does not have
ivl_wire_status_t ivl_parts_take(ivl_parts_t *parts, const ivl_wire_policy_t *part);

/// True for the last part in order: its sender waits for an answer.
bool ivl_parts_is_last(const ivl_wire_policy_t *part);
#endif  // IVL_PARTS_H
