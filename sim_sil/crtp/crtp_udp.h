/// @file crtp_udp.h
/// UDP sockets of the server.  An address is one number, so that the other files need no socket headers.
#ifndef IVL_CRTP_UDP_H
#define IVL_CRTP_UDP_H
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// Opens a socket and binds it; port 0 takes a free one.
/// @param[out] error  one line, if the result is -1
int  ivl_crtp_udp_open(const char *address, uint16_t *port, char *error, size_t error_size);
void ivl_crtp_udp_close(int fd);

typedef enum
{
    IVL_CRTP_UDP_NOTHING,
    IVL_CRTP_UDP_PACKET,
    IVL_CRTP_UDP_GONE  ///< nobody listens at `peer`
} ivl_crtp_udp_event_t;

/// Next event, without waiting.  A datagram that is longer than `capacity` is given with its true size and without its end.
ivl_crtp_udp_event_t ivl_crtp_udp_take(int fd, uint8_t *bytes, size_t capacity, size_t *size, uint64_t *peer);

/// Sends without waiting.  What the machine cannot take is lost, as on any network.
void ivl_crtp_udp_send(int fd, uint64_t peer, const void *bytes, size_t size);

/// Whether this system tells when a packet finds nobody at an address.
bool ivl_crtp_udp_tells(uint64_t peer);

/// Waits for an event on either socket; fd_2 may be -1.
void ivl_crtp_udp_wait(int fd_1, int fd_2, uint64_t wait_us);

/// Address as text, "127.0.0.1:19850".
void ivl_crtp_udp_text(uint64_t peer, char *text, size_t size);
#endif  // IVL_CRTP_UDP_H
