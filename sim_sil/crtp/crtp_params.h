/// @file crtp_params.h
/// Port 2: parameters.
#ifndef IVL_CRTP_PARAMS_H
#define IVL_CRTP_PARAMS_H
#include "crtp_server.h"

bool ivl_crtp_params_open(ivl_crtp_t *crtp, char *error, size_t error_size);
void ivl_crtp_params_close(ivl_crtp_t *crtp);

/// The present values are the defaults; for the program around it, which may set some of the server's own after the opening.
void ivl_crtp_params_take_defaults(ivl_crtp_t *crtp);

/// Stored values of persistent parameters take effect, as after power-on.
void ivl_crtp_params_restore(ivl_crtp_t *crtp);

/// Clients start anew: what the values are now needs not be told them.
void ivl_crtp_params_forget(ivl_crtp_t *crtp);
void ivl_crtp_params_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet);

/// Tells the client which values have changed other than by his own writing.
void ivl_crtp_params_step(ivl_crtp_t *crtp);

/// Copies a value into a parameter and tells who must know.  @return true if the answer has to wait
bool ivl_crtp_params_write(ivl_crtp_t *crtp, uint16_t id, const uint8_t *value);

/// Bytes of a value; 0 for an unknown type.
size_t ivl_crtp_param_size(uint8_t type);
#endif  // IVL_CRTP_PARAMS_H
