/// @file crtp_power.h
/// Packets to the radio's own processor, which switches the power of the vehicle's: FFh, then FEh and a command.  They take no client's place and
/// are answered whether the vehicle has power or not.
#ifndef IVL_CRTP_POWER_H
#define IVL_CRTP_POWER_H
#include "crtp_server.h"

bool ivl_crtp_is_power(const uint8_t *bytes, size_t size);

/// Obey one.
/// @param[out] reply  to its sender
void ivl_crtp_power(ivl_crtp_t *crtp, const uint8_t *bytes, size_t size, ivl_crtp_packet_t *reply);
#endif  // IVL_CRTP_POWER_H
