#include "crtp_power.h"

#include "crtp_dispatch.h"
#include "crtp_params.h"

enum
{
    TARGET = 0xFE,  // the radio's processor
    ALL_OFF = 0x01,
    SYSTEM_OFF = 0x02,
    SYSTEM_ON = 0x03,
    RESET = 0xF0,
    RESET_INIT = 0xFF,
    TO_FIRMWARE = 1,
    LINK_CHANNEL = 3
};

bool ivl_crtp_is_power(const uint8_t *bytes, size_t size)
{
    return (size >= 3u) && ((bytes[0] & 0xF3u) == 0xF3u) && (bytes[1] == TARGET);
}

static void off(ivl_crtp_t *crtp)
{
    if (!crtp->is_off)
    {
        ivl_crtp_link(crtp, false);
        ivl_cf_power_off(crtp->cf);
        crtp->is_off = true;
    }
}

static void on(ivl_crtp_t *crtp)
{
    if (crtp->is_off)
    {
        crtp->is_off = false;
        ivl_cf_power_on(crtp->cf);
        ivl_crtp_params_restore(crtp);
        ivl_crtp_params_forget(crtp);
    }
}

void ivl_crtp_power(ivl_crtp_t *crtp, const uint8_t *bytes, size_t size, ivl_crtp_packet_t *reply)
{
    const uint8_t command = bytes[2];
    *reply = ivl_crtp_packet(IVL_CRTP_PORT_LINK, LINK_CHANNEL);
    switch (command)
    {
    case ALL_OFF:
    case SYSTEM_OFF:
        off(crtp);
        break;
    case SYSTEM_ON:
        on(crtp);
        break;
    case RESET_INIT:
        // with the address under which its loader would answer
        ivl_crtp_put_u8(reply, TARGET);
        ivl_crtp_put_u8(reply, RESET_INIT);
        ivl_crtp_put_u8(reply, crtp->address);
        ivl_crtp_put_bytes(reply, (const uint8_t[]){0xE7, 0xE7, 0xE7}, 3);
        break;
    case RESET:
        if ((size == 4u) && (bytes[3] == TO_FIRMWARE))
        {
            off(crtp);
            on(crtp);
        }
        else
        {
            // there is no loader to start
            ivl_crtp_bad(crtp);
        }
        break;
    default:
        ivl_crtp_bad(crtp);
        break;
    }
}
