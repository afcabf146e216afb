#include "crtp_server.h"

void ivl_crtp_send(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet)
{
    crtp->own.n_tx++;
    crtp->host.send(crtp->host.context, packet);
}

void ivl_crtp_bad(ivl_crtp_t *crtp)
{
    crtp->own.n_bad++;
}

uint64_t ivl_crtp_time_ms(const ivl_crtp_t *crtp)
{
    return ivl_cf_time_us(crtp->cf) / 1000u;
}
