/// @file crtp_commands.h
/// Ports that move the vehicle: set-points, high-level commander, poses from outside.
#ifndef IVL_CRTP_COMMANDS_H
#define IVL_CRTP_COMMANDS_H
#include "crtp_server.h"

void ivl_crtp_rpyt_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet);
void ivl_crtp_generic_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet);
void ivl_crtp_high_level_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet);
void ivl_crtp_localization_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet);
#endif  // IVL_CRTP_COMMANDS_H
