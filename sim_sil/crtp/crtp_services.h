/// @file crtp_services.h
/// Ports that answer about the vehicle.
#ifndef IVL_CRTP_SERVICES_H
#define IVL_CRTP_SERVICES_H
#include "crtp_server.h"

#define IVL_CRTP_VERSION 12u

void ivl_crtp_memory_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet);
void ivl_crtp_supervisor_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet);
void ivl_crtp_platform_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet);
void ivl_crtp_link_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet);
#endif  // IVL_CRTP_SERVICES_H
