/// @file crtp_control.h
/// The control channel: parameters and log variables by name, as text, past every fault of the link.
///     "fault.loss"       -> "fault.loss=0.05"
///     "fault.loss=0.2"   -> "fault.loss=0.2"     written, then read back
///     "sil.n_rx"         -> "sil.n_rx=1234"      log variables can only be read
///     anything else      -> "error: ..."
#ifndef IVL_CRTP_CONTROL_H
#define IVL_CRTP_CONTROL_H
#include "crtp_server.h"

enum
{
    IVL_CRTP_CONTROL_BYTES = 200
};

/// @param[in,out] request  `size` characters, not terminated
/// @param[out] reply       a line without its end
void ivl_crtp_control(ivl_crtp_t *crtp, const char *request, size_t size, char reply[IVL_CRTP_CONTROL_BYTES]);
#endif  // IVL_CRTP_CONTROL_H
