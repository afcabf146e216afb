/// @file crtp_session.h
/// Whose vehicle it is.  The first to send something has it, until his socket is known to be gone; then the one who asked last gets it.  Who is
/// silent for a second gives way to anybody else, and keeps the vehicle only where his socket is known to be there.
/// Pure: time and addresses are arguments.
#ifndef IVL_CRTP_SESSION_H
#define IVL_CRTP_SESSION_H
#include "crtp_faults.h"

#define IVL_CRTP_SILENCE_US 1000000u
#define IVL_CRTP_SWITCH_US  200000u  ///< a request to switch the power waits so long for the client to be known to have gone, and no longer

typedef struct
{
    bool                live;
    uint64_t            peer, heard_us;
    bool                is_waited_for;  ///< somebody else wants something; his request is kept
    uint64_t            waits_until_us;
    ivl_crtp_datagram_t waiting;
} ivl_crtp_session_t;

typedef enum
{
    IVL_CRTP_CLIENT,  ///< the one who has the vehicle
    IVL_CRTP_NEW,     ///< has it from now on
    IVL_CRTP_FOREIGN  ///< another one: his packet is passed over; but if it is the first of a connection (15/1), it waits for the client to go, and
                      ///< if the client is silent, any packet waits until all that has come by now is heard
} ivl_crtp_who_t;

/// The request with which a client begins.
bool ivl_crtp_is_link_source(const ivl_crtp_datagram_t *datagram);

/// A packet that says something has come.
ivl_crtp_who_t ivl_crtp_session_hear(ivl_crtp_session_t *session, uint64_t now_us, const ivl_crtp_datagram_t *datagram);

/// Whether the sender of a packet that takes no place, as those that switch the power, may be obeyed: he is the client, or there is none.  Another
/// one's packet waits for a moment, since a client who has just closed his socket is not yet known to be gone; if he is silent it waits for his end.
bool ivl_crtp_session_may(ivl_crtp_session_t *session, uint64_t now_us, const ivl_crtp_datagram_t *datagram);

/// Such a packet waits: the client is to be asked whether he is still there.
bool ivl_crtp_session_is_pressed(const ivl_crtp_session_t *session, uint64_t now_us);

/// The client has not spoken for a second.
bool ivl_crtp_session_is_silent(const ivl_crtp_session_t *session, uint64_t now_us);

/// @param is_there  the system would tell if his socket were closed
/// @return true if the client has just been given up for his silence
bool ivl_crtp_session_expire(ivl_crtp_session_t *session, uint64_t now_us, bool is_there);

/// Nobody listens at this address.  @return true if it was the client's, who is given up
bool ivl_crtp_session_gone(ivl_crtp_session_t *session, uint64_t peer);

/// The request of the one who waited, if the vehicle is free and the request has not waited too long.
bool ivl_crtp_session_next(ivl_crtp_session_t *session, uint64_t now_us, ivl_crtp_datagram_t *datagram);
#endif  // IVL_CRTP_SESSION_H
