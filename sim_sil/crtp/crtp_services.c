/// @file crtp_services.c
/// Ports that answer about the vehicle: memory (4), supervisor (9), platform (13), link (15).
#include <stdio.h>
#include <string.h>

#include "crtp_services.h"

static const char FIRMWARE[] = "inverted landing SIL";
static const char DEVICE[] = "Crazyflie SIL";

// ---- memory

enum
{
    MEMORY_INFO_COUNT = 1,
    MEMORY_INFO_ITEM = 2,
    MEMORY_READ_MAX = IVL_CRTP_PAYLOAD_MAX - 6
};

static void memory_info(ivl_crtp_t *crtp, ivl_crtp_reader_t *r, const ivl_cf_memory_t *memories, size_t n)
{
    const uint8_t     command = ivl_crtp_u8(r);
    ivl_crtp_packet_t reply = ivl_crtp_packet(IVL_CRTP_PORT_MEMORY, 0);
    ivl_crtp_put_u8(&reply, command);
    if ((command == MEMORY_INFO_COUNT) && ivl_crtp_exact(r))
    {
        ivl_crtp_put_u8(&reply, (uint8_t)n);
        ivl_crtp_send(crtp, &reply);
        return;
    }
    const uint8_t id = ivl_crtp_u8(r);
    if ((command != MEMORY_INFO_ITEM) || !ivl_crtp_exact(r))
    {
        ivl_crtp_bad(crtp);
        return;
    }
    ivl_crtp_put_u8(&reply, id);
    if (id < n)
    {
        ivl_crtp_put_u8(&reply, memories[id].type);
        ivl_crtp_put_u32(&reply, memories[id].size());
        ivl_crtp_put_bytes(&reply, memories[id].serial, sizeof memories[id].serial);
    }
    ivl_crtp_send(crtp, &reply);
}

static bool in_range(const ivl_cf_memory_t *memory, uint32_t address, size_t size)
{
    const uint32_t total = memory->size();
    return (size <= total) && (address <= total - size);
}

static void memory_read(ivl_crtp_t *crtp, ivl_crtp_reader_t *r, const ivl_cf_memory_t *memories, size_t n)
{
    const uint8_t  id = ivl_crtp_u8(r);
    const uint32_t address = ivl_crtp_u32(r);
    const uint8_t  size = ivl_crtp_u8(r);
    uint8_t        bytes[MEMORY_READ_MAX];
    if (!ivl_crtp_exact(r))
    {
        ivl_crtp_bad(crtp);
        return;
    }
    const bool good =
        (id < n) && (size <= MEMORY_READ_MAX) && in_range(&memories[id], address, size) && memories[id].read(address, size, bytes);
    ivl_crtp_packet_t reply = ivl_crtp_packet(IVL_CRTP_PORT_MEMORY, 1);
    ivl_crtp_put_u8(&reply, id);
    ivl_crtp_put_u32(&reply, address);
    ivl_crtp_put_u8(&reply, good ? IVL_CRTP_OK : IVL_CRTP_EIO);
    ivl_crtp_put_bytes(&reply, bytes, good ? size : 0u);
    ivl_crtp_send(crtp, &reply);
}

static void memory_write(ivl_crtp_t *crtp, ivl_crtp_reader_t *r, const ivl_cf_memory_t *memories, size_t n)
{
    const uint8_t  id = ivl_crtp_u8(r);
    const uint32_t address = ivl_crtp_u32(r);
    if (!r->good)
    {
        ivl_crtp_bad(crtp);
        return;
    }
    const size_t      size = ivl_crtp_left(r);
    const uint8_t    *bytes = ivl_crtp_take(r, size);
    const bool        good = (id < n) && (memories[id].write != NULL) && in_range(&memories[id], address, size) &&
                             memories[id].write(address, (uint32_t)size, bytes);
    ivl_crtp_packet_t reply = ivl_crtp_packet(IVL_CRTP_PORT_MEMORY, 2);
    ivl_crtp_put_u8(&reply, id);
    ivl_crtp_put_u32(&reply, address);
    ivl_crtp_put_u8(&reply, good ? IVL_CRTP_OK : IVL_CRTP_EIO);
    ivl_crtp_send(crtp, &reply);
}

void ivl_crtp_memory_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet)
{
    size_t                 n;
    const ivl_cf_memory_t *memories = ivl_cf_memories(crtp->cf, &n);
    ivl_crtp_reader_t      r = ivl_crtp_read(packet);
    switch (packet->channel)
    {
    case 0:
        memory_info(crtp, &r, memories, n);
        break;
    case 1:
        memory_read(crtp, &r, memories, n);
        break;
    case 2:
        memory_write(crtp, &r, memories, n);
        break;
    default:
        ivl_crtp_bad(crtp);
        break;
    }
}

// ---- supervisor

enum
{
    SUPERVISOR_BITS = 11,  ///< requests 1 .. 11 ask for bits 0 .. 10
    SUPERVISOR_INFO = 0x0C,
    SUPERVISOR_ANSWER = 0x80
};

static void answer_two(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet, uint8_t command, bool first, bool second)
{
    ivl_crtp_packet_t reply = ivl_crtp_packet(packet->port, packet->channel);
    ivl_crtp_put_u8(&reply, command);
    ivl_crtp_put_u8(&reply, first ? 1 : 0);
    ivl_crtp_put_u8(&reply, second ? 1 : 0);
    ivl_crtp_send(crtp, &reply);
}

static void supervisor_info(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet, ivl_crtp_reader_t *r)
{
    const uint8_t  command = ivl_crtp_u8(r);
    const uint16_t bits = ivl_cf_supervisor_info(crtp->cf);
    if (!ivl_crtp_exact(r) || (command < 1u) || (command > SUPERVISOR_INFO))
    {
        ivl_crtp_bad(crtp);
        return;
    }
    ivl_crtp_packet_t reply = ivl_crtp_packet(packet->port, packet->channel);
    ivl_crtp_put_u8(&reply, SUPERVISOR_ANSWER | command);
    if (command == SUPERVISOR_INFO)
    {
        ivl_crtp_put_u16(&reply, bits);
    }
    else
    {
        ivl_crtp_put_u8(&reply, (bits >> (command - 1u)) & 1u);
    }
    ivl_crtp_send(crtp, &reply);
}

// arm and recover, the same on two ports; only the first byte of the answer differs
static bool arm_or_recover(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet, ivl_crtp_reader_t *r, uint8_t command, uint8_t answer)
{
    if (command == 1u)
    {
        const bool wish = ivl_crtp_u8(r) != 0u;
        if (ivl_crtp_exact(r))
        {
            const bool granted = ivl_cf_arm(crtp->cf, wish);
            answer_two(crtp, packet, answer, granted, ivl_cf_is_armed(crtp->cf));
            return true;
        }
    }
    if ((command == 2u) && ivl_crtp_exact(r))
    {
        const bool recovered = ivl_cf_recover(crtp->cf);
        answer_two(crtp, packet, answer, recovered, ((ivl_cf_supervisor_info(crtp->cf) >> 7) & 1u) == 0u);
        return true;
    }
    return false;
}

void ivl_crtp_supervisor_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet)
{
    ivl_crtp_reader_t r = ivl_crtp_read(packet);
    if (packet->channel == 0u)
    {
        supervisor_info(crtp, packet, &r);
        return;
    }
    const uint8_t command = ivl_crtp_u8(&r);
    if ((packet->channel != 1u) || !r.good)
    {
        ivl_crtp_bad(crtp);
    }
    else if ((command == 3u) && ivl_crtp_exact(&r))
    {
        ivl_cf_estop(crtp->cf);
    }
    else if ((command == 4u) && ivl_crtp_exact(&r))
    {
        ivl_cf_estop_watchdog(crtp->cf);
    }
    else if (!arm_or_recover(crtp, packet, &r, command, SUPERVISOR_ANSWER | command))
    {
        ivl_crtp_bad(crtp);
    }
}

// ---- platform

static void platform_command(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet, ivl_crtp_reader_t *r)
{
    enum
    {
        CONTINUOUS_WAVE = 0,
        USER_NOTIFICATION = 3
    };
    const uint8_t command = ivl_crtp_u8(r);
    if (r->good && ((command == CONTINUOUS_WAVE) || (command == USER_NOTIFICATION)))
    {
        // neither radio test nor lamps here: acknowledged as the drone does it
        ivl_crtp_packet_t reply = ivl_crtp_packet(packet->port, packet->channel);
        ivl_crtp_put_bytes(&reply, packet->data, (command == CONTINUOUS_WAVE) ? packet->size : 0u);
        ivl_crtp_send(crtp, &reply);
        return;
    }
    if (!arm_or_recover(crtp, packet, r, command, command))
    {
        ivl_crtp_bad(crtp);
    }
}

static void platform_version(ivl_crtp_t *crtp, ivl_crtp_reader_t *r)
{
    const uint8_t     command = ivl_crtp_u8(r);
    ivl_crtp_packet_t reply = ivl_crtp_packet(IVL_CRTP_PORT_PLATFORM, 1);
    ivl_crtp_put_u8(&reply, command);
    if (!r->good || (command > 2u))
    {
        ivl_crtp_bad(crtp);
        return;
    }
    if (command == 0u)
    {
        ivl_crtp_put_u32(&reply, IVL_CRTP_VERSION);
    }
    else
    {
        const char *text = (command == 1u) ? FIRMWARE : DEVICE;
        ivl_crtp_put_bytes(&reply, text, strlen(text));
    }
    ivl_crtp_send(crtp, &reply);
}

void ivl_crtp_platform_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet)
{
    ivl_crtp_reader_t r = ivl_crtp_read(packet);
    switch (packet->channel)
    {
    case 0:
        platform_command(crtp, packet, &r);
        break;
    case 1:
        platform_version(crtp, &r);
        break;
    case 2:
        // a full queue loses the packet, as on the drone
        (void)ivl_cf_app_receive(crtp->cf, packet->data, packet->size);
        break;
    default:
        ivl_crtp_bad(crtp);
        break;
    }
}

// ---- link

void ivl_crtp_link_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet)
{
    enum
    {
        ECHO = 0,
        SOURCE = 1,
        SINK = 2
    };
    static const char SOURCE_TEXT[IVL_CRTP_PAYLOAD_MAX] = "Bitcraze Crazyflie";
    if (packet->channel == ECHO)
    {
        ivl_crtp_send(crtp, packet);
    }
    else if (packet->channel == SOURCE)
    {
        ivl_crtp_packet_t reply = ivl_crtp_packet(IVL_CRTP_PORT_LINK, SOURCE);
        ivl_crtp_put_bytes(&reply, SOURCE_TEXT, sizeof SOURCE_TEXT);
        ivl_crtp_send(crtp, &reply);
    }
    else if (packet->channel != SINK)
    {
        ivl_crtp_bad(crtp);
    }
}
