/// @file crtp_dispatch.h
/// The CRTP server: bytes in, calls of the vehicle, bytes out.  It knows neither sockets nor the wall clock, so that tests and a fuzzer can
/// drive it alone.  Protocol version 12.
///
/// Rule for lengths: a packet has exactly the bytes of its table in docs/SIL.md.  Any other is counted (log sil.n_bad) and changes nothing;
/// it is answered with EINVAL where the table has an error byte.  Longer requests are taken only where clients are known to send them: log
/// blocks (a stray byte), link service, version.
#ifndef IVL_CRTP_DISPATCH_H
#define IVL_CRTP_DISPATCH_H
#include "crtp_server.h"

/// @param[out] error  one line, if the result is false
bool ivl_crtp_open(ivl_crtp_t *crtp, ivl_cf_t *cf, const ivl_crtp_host_t *host, char *error, size_t error_size);
void ivl_crtp_close(ivl_crtp_t *crtp);

/// A datagram of the client.
void ivl_crtp_receive(ivl_crtp_t *crtp, const uint8_t *bytes, size_t size);

/// One millisecond of the vehicle, and all packets that follow from it.
void ivl_crtp_step(ivl_crtp_t *crtp);

/// The client has come or gone; gone, its log blocks are deleted, as over radio.
void ivl_crtp_link(ivl_crtp_t *crtp, bool up);
#endif  // IVL_CRTP_DISPATCH_H
