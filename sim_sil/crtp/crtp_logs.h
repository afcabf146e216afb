/// @file crtp_logs.h
/// Port 5: log blocks.
#ifndef IVL_CRTP_LOGS_H
#define IVL_CRTP_LOGS_H
#include "crtp_server.h"

bool ivl_crtp_logs_open(ivl_crtp_t *crtp, char *error, size_t error_size);
void ivl_crtp_logs_close(ivl_crtp_t *crtp);
void ivl_crtp_logs_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet);
void ivl_crtp_logs_step(ivl_crtp_t *crtp);
void ivl_crtp_logs_reset(ivl_crtp_t *crtp);
#endif  // IVL_CRTP_LOGS_H
