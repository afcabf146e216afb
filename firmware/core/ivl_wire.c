/// @file ivl_wire.c
#include "ivl_wire.h"

#include <string.h>

// ---- one member, little-endian whatever the machine

static void put_bytes(uint8_t *at, uint32_t value, size_t size)
{
    for (size_t i = 0; i < size; i++)
    {
        at[i] = (uint8_t)(value >> (8u * i));
    }
}

static uint32_t get_bytes(const uint8_t *at, size_t size)
{
    uint32_t value = 0;
    for (size_t i = size; i > 0; i--)
    {
        value = (value << 8) | at[i - 1u];
    }
    return value;
}

// a member's number as the machine keeps it
static uint32_t load(const void *member, size_t size)
{
    uint8_t  one;
    uint16_t two;
    uint32_t four;
    switch (size)
    {
    case sizeof one:
        memcpy(&one, member, sizeof one);
        return one;
    case sizeof two:
        memcpy(&two, member, sizeof two);
        return two;
    default:
        memcpy(&four, member, sizeof four);
        return four;
    }
}

static void store(void *member, uint32_t value, size_t size)
{
    const uint8_t  one = (uint8_t)value;
    const uint16_t two = (uint16_t)value;
    switch (size)
    {
    case sizeof one:
        memcpy(member, &one, sizeof one);
        break;
    case sizeof two:
        memcpy(member, &two, sizeof two);
        break;
    default:
        memcpy(member, &value, sizeof value);
        break;
    }
}

void ivl_wire_put_f32(uint8_t *bytes, float value)
{
    put_bytes(bytes, load(&value, sizeof value), sizeof value);
}

// ---- whole packets, from their tables

typedef struct
{
    uint8_t offset, size;
} place_t;

typedef struct
{
    const place_t *places;
    uint8_t        n;
    uint8_t        type;
    uint8_t        size;  // of the packet
} layout_t;

static size_t put(uint8_t *bytes, const layout_t *layout, const void *packet)
{
    uint8_t *at = bytes + 2;
    bytes[0] = layout->type;
    bytes[1] = (uint8_t)IVL_WIRE_VERSION;
    for (const place_t *m = layout->places; m < layout->places + layout->n; m++)
    {
        put_bytes(at, load((const uint8_t *)packet + m->offset, m->size), m->size);
        at += m->size;
    }
    return layout->size;
}

static bool get(const uint8_t *bytes, size_t size, const layout_t *layout, void *packet)
{
    if ((size != layout->size) || (bytes[0] != layout->type) || (bytes[1] != (uint8_t)IVL_WIRE_VERSION))
    {
        return false;
    }
    const uint8_t *at = bytes + 2;
    for (const place_t *m = layout->places; m < layout->places + layout->n; m++)
    {
        store((uint8_t *)packet + m->offset, get_bytes(at, m->size), m->size);
        at += m->size;
    }
    return true;
}

#define SIZE_OF(type, name, unit, doc) +sizeof(ivl_##type##_t)
#define PLACE(type, name, unit, doc)   {offsetof(packet_t, name), sizeof(ivl_##type##_t)},

#define CODEC(lower, UPPER)                                                                                                                \
    _Static_assert(2u IVL_WIRE_##UPPER(SIZE_OF) <= IVL_WIRE_SIZE_MAX, "a packet fits into the channel");                                   \
    static const layout_t *layout_of_##lower(void)                                                                                         \
    {                                                                                                                                      \
        typedef ivl_wire_##lower##_t packet_t;                                                                                             \
        static const place_t         PLACES[] = {IVL_WIRE_##UPPER(PLACE)};                                                                 \
        static const layout_t        LAYOUT = {.places = PLACES,                                                                           \
                                               .n = (uint8_t)(sizeof PLACES / sizeof PLACES[0]),                                           \
                                               .type = (uint8_t)IVL_WIRE_TYPE_##UPPER,                                                     \
                                               .size = (uint8_t)(2u IVL_WIRE_##UPPER(SIZE_OF))};                                           \
        return &LAYOUT;                                                                                                                    \
    }                                                                                                                                      \
    size_t ivl_wire_put_##lower(uint8_t *bytes, const ivl_wire_##lower##_t *packet)                                                        \
    {                                                                                                                                      \
        return put(bytes, layout_of_##lower(), packet);                                                                                    \
    }                                                                                                                                      \
    bool ivl_wire_get_##lower(const uint8_t *bytes, size_t size, ivl_wire_##lower##_t *packet)                                             \
    {                                                                                                                                      \
        return get(bytes, size, layout_of_##lower(), packet);                                                                              \
    }

CODEC(policy, POLICY)
CODEC(command, COMMAND)
CODEC(reading, READING)
CODEC(policy_echo, POLICY_ECHO)
CODEC(command_echo, COMMAND_ECHO)
CODEC(config_echo, CONFIG_ECHO)

uint32_t ivl_wire_crc(uint32_t crc, const void *data, size_t size)
{
    const uint8_t *bytes = (const uint8_t *)data;
    crc = ~crc;
    for (size_t i = 0; i < size; i++)
    {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; bit++)
        {
            crc = (crc >> 1) ^ (((crc & 1u) != 0u) ? 0xEDB88320u : 0u);
        }
    }
    return ~crc;
}
