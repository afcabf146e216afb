#include "crtp_session.h"

bool ivl_crtp_is_link_source(const ivl_crtp_datagram_t *datagram)
{
    return (datagram->size > 0u) && ((datagram->bytes[0] & 0xF3u) == ((IVL_CRTP_PORT_LINK << 4) | 1u));
}

static void wait(ivl_crtp_session_t *session, const ivl_crtp_datagram_t *datagram, uint64_t until_us)
{
    session->is_waited_for = true;
    session->waits_until_us = until_us;
    session->waiting = *datagram;
}

static bool is_waited_for(const ivl_crtp_session_t *session, uint64_t now_us)
{
    return session->is_waited_for && (now_us <= session->waits_until_us);
}

ivl_crtp_who_t ivl_crtp_session_hear(ivl_crtp_session_t *session, uint64_t now_us, const ivl_crtp_datagram_t *datagram)
{
    if (session->live && (session->peer != datagram->peer))
    {
        // anything else would be a command that takes effect long after it was given
        if (ivl_crtp_is_link_source(datagram) || ivl_crtp_session_is_silent(session, now_us))
        {
            wait(session, datagram, UINT64_MAX);
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

bool ivl_crtp_session_may(ivl_crtp_session_t *session, uint64_t now_us, const ivl_crtp_datagram_t *datagram)
{
    const bool may = !session->live || (session->peer == datagram->peer);
    // who wants to connect has asked for more, and earlier
    if (!may && !is_waited_for(session, now_us))
    {
        wait(session, datagram, ivl_crtp_session_is_silent(session, now_us) ? UINT64_MAX : now_us + IVL_CRTP_SWITCH_US);
    }
    return may;
}

bool ivl_crtp_session_is_pressed(const ivl_crtp_session_t *session, uint64_t now_us)
{
    return session->live && is_waited_for(session, now_us) && (session->waits_until_us != UINT64_MAX);
}

bool ivl_crtp_session_is_silent(const ivl_crtp_session_t *session, uint64_t now_us)
{
    return session->live && (now_us > session->heard_us + IVL_CRTP_SILENCE_US);
}

bool ivl_crtp_session_expire(ivl_crtp_session_t *session, uint64_t now_us, bool is_there)
{
    const bool expired = ivl_crtp_session_is_silent(session, now_us) && (is_waited_for(session, now_us) || !is_there);
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

bool ivl_crtp_session_next(ivl_crtp_session_t *session, uint64_t now_us, ivl_crtp_datagram_t *datagram)
{
    if (session->live || !is_waited_for(session, now_us))
    {
        return false;
    }
    session->is_waited_for = false;
    *datagram = session->waiting;
    return true;
}
