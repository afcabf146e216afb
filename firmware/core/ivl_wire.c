/// @file ivl_wire.c
#include "ivl_wire.h"

#include <string.h>

// ---- one member, little-endian whatever the machine

static uint8_t *put_bytes(uint8_t *at, uint32_t value, size_t size)
{
    for (size_t i = 0; i < size; i++)
    {
        at[i] = (uint8_t)(value >> (8u * i));
    }
    return at + size;
}

static const uint8_t *get_bytes(const uint8_t *at, uint32_t *value, size_t size)
{
    *value = 0;
    for (size_t i = 0; i < size; i++)
    {
        *value |= (uint32_t)at[i] << (8u * i);
    }
    return at + size;
}

static uint32_t bits_of_f32(float x)
{
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

static float f32_of_bits(uint32_t bits)
{
    float x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

void ivl_wire_put_f32(uint8_t *bytes, float value)
{
    (void)put_bytes(bytes, bits_of_f32(value), sizeof value);
}

#define BITS_u8(x)  (x)
#define BITS_u16(x) (x)
#define BITS_u32(x) (x)
#define BITS_i8(x)  ((uint8_t)(x))
#define BITS_f32(x) bits_of_f32(x)

#define VALUE_u8(bits)  ((uint8_t)(bits))
#define VALUE_u16(bits) ((uint16_t)(bits))
#define VALUE_u32(bits) (bits)
#define VALUE_i8(bits)  ((int8_t)(uint8_t)(bits))
#define VALUE_f32(bits) f32_of_bits(bits)

// ---- whole packets, from their tables

#define SIZE_OF(type, name, unit, doc) +sizeof(ivl_##type##_t)
#define PUT(type, name, unit, doc)     at = put_bytes(at, BITS_##type(packet->name), sizeof(ivl_##type##_t));
#define GET(type, name, unit, doc)                                                                                                         \
    at = get_bytes(at, &bits, sizeof(ivl_##type##_t));                                                                                     \
    packet->name = VALUE_##type(bits);

#define CODEC(lower, UPPER)                                                                                                                \
    _Static_assert(2u IVL_WIRE_##UPPER(SIZE_OF) <= IVL_WIRE_SIZE_MAX, "a packet fits into the channel");                                   \
    size_t ivl_wire_put_##lower(uint8_t *bytes, const ivl_wire_##lower##_t *packet)                                                        \
    {                                                                                                                                      \
        uint8_t *at = bytes + 2;                                                                                                           \
        bytes[0] = (uint8_t)IVL_WIRE_TYPE_##UPPER;                                                                                         \
        bytes[1] = (uint8_t)IVL_WIRE_VERSION;                                                                                              \
        IVL_WIRE_##UPPER(PUT) return (size_t)(at - bytes);                                                                                 \
    }                                                                                                                                      \
    bool ivl_wire_get_##lower(const uint8_t *bytes, size_t size, ivl_wire_##lower##_t *packet)                                             \
    {                                                                                                                                      \
        if ((size != 2u IVL_WIRE_##UPPER(SIZE_OF)) || (bytes[0] != (uint8_t)IVL_WIRE_TYPE_##UPPER) ||                                      \
            (bytes[1] != (uint8_t)IVL_WIRE_VERSION))                                                                                       \
        {                                                                                                                                  \
            return false;                                                                                                                  \
        }                                                                                                                                  \
        const uint8_t *at = bytes + 2;                                                                                                     \
        uint32_t       bits;                                                                                                               \
        IVL_WIRE_##UPPER(GET) return true;                                                                                                 \
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
