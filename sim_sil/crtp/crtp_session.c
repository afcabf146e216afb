#include "crtp_session.h"

bool ivl_crtp_is_link_source(const ivl_crtp_datagram_t *datagram)
{
    return (datagram->size > 0u) && ((datagram->bytes[0] & 0xF3u) == ((IVL_CRTP_PORT_LINK << 4) | 1u));
}

ivl_crtp_who_t ivl_crtp_session_hear(ivl_crtp_session_t *session, uint64_t now_us, const ivl_crtp_datagram_t *datagram)
{
    if (session->live && (session->peer != datagram->peer))
    {
        // anything else would be a command that takes effect long after it was given
        if (ivl_crtp_is_link_source(datagram) || ivl_crtp_session_is_silent(session, now_us))
        {
            session->is_waited_for = true;
            session->waiting = *datagram;
        }
        return IVL_CRTP_FOREIGN;
    }
    const bool is_new = !session->live;
    session->live = true;
    session->peer = datagram->peer;
    session->heard_us = now_us;
    session->is_waited_for = session->is_waited_for && ivl_crtp_is_link_source(&session->waiting);
    return is_new ? IVL_CRTP_NEW : IVL_CRTP_CLIENT;
}

bool ivl_crtp_session_is_silent(const ivl_crtp_session_t *session, uint64_t now_us)
{
    return session->live && (now_us > session->heard_us + IVL_CRTP_SILENCE_US);
}

bool ivl_crtp_session_expire(ivl_crtp_session_t *session, uint64_t now_us, bool is_there)
{
    const bool expired = ivl_crtp_session_is_silent(session, now_us) && (session->is_waited_for || !is_there);
    session->live = session->live && !expired;
    return expired;
}

bool ivl_crtp_session_gone(ivl_crtp_session_t *session, uint64_t peer)
{
    if (session->is_waited_for && (session->waiting.peer == peer))
    {
        session->is_waited_for = false;
    }
    const bool gone = session->live && (session->peer == peer);
    session->live = session->live && !gone;
    return gone;
}

bool ivl_crtp_session_next(ivl_crtp_session_t *session, ivl_crtp_datagram_t *datagram)
{
    if (session->live || !session->is_waited_for)
    {
        return false;
    }
    session->is_waited_for = false;
    *datagram = session->waiting;
    return true;
}
