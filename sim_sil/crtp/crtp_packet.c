#include "crtp_packet.h"

#include <assert.h>
#include <string.h>

bool ivl_crtp_parse(ivl_crtp_packet_t *packet, const uint8_t *bytes, size_t size)
{
    if ((size < 1u) || (size > IVL_CRTP_BYTES_MAX))
    {
        return false;
    }
    *packet = ivl_crtp_packet((uint8_t)(bytes[0] >> 4), bytes[0] & 0x03u);
    packet->size = (uint8_t)(size - 1u);
    memcpy(packet->data, bytes + 1, size - 1u);
    return true;
}

size_t ivl_crtp_bytes(const ivl_crtp_packet_t *packet, uint8_t *bytes)
{
    bytes[0] = (uint8_t)(((unsigned)packet->port << 4) | 0x0Cu | packet->channel);
    memcpy(bytes + 1, packet->data, packet->size);
    return 1u + packet->size;
}

ivl_crtp_packet_t ivl_crtp_packet(uint8_t port, uint8_t channel)
{
    return (ivl_crtp_packet_t){.port = port, .channel = channel};
}

void ivl_crtp_put_bytes(ivl_crtp_packet_t *packet, const void *bytes, size_t size)
{
    const bool fits = size <= (size_t)(IVL_CRTP_PAYLOAD_MAX - packet->size);
    assert(fits);
    if (fits && (size > 0u))
    {
        memcpy(packet->data + packet->size, bytes, size);
        packet->size = (uint8_t)(packet->size + size);
    }
}

void ivl_crtp_put_u8(ivl_crtp_packet_t *packet, uint8_t value)
{
    ivl_crtp_put_bytes(packet, &value, sizeof value);
}

void ivl_crtp_put_u16(ivl_crtp_packet_t *packet, uint16_t value)
{
    const uint8_t bytes[] = {(uint8_t)value, (uint8_t)(value >> 8)};
    ivl_crtp_put_bytes(packet, bytes, sizeof bytes);
}

void ivl_crtp_put_u32(ivl_crtp_packet_t *packet, uint32_t value)
{
    const uint8_t bytes[] = {(uint8_t)value, (uint8_t)(value >> 8), (uint8_t)(value >> 16), (uint8_t)(value >> 24)};
    ivl_crtp_put_bytes(packet, bytes, sizeof bytes);
}

void ivl_crtp_put_text(ivl_crtp_packet_t *packet, const char *text)
{
    ivl_crtp_put_bytes(packet, text, strlen(text) + 1u);
}

ivl_crtp_reader_t ivl_crtp_read(const ivl_crtp_packet_t *packet)
{
    return (ivl_crtp_reader_t){.bytes = packet->data, .size = packet->size, .good = true};
}

const uint8_t *ivl_crtp_take(ivl_crtp_reader_t *reader, size_t size)
{
    if (size > ivl_crtp_left(reader))
    {
        reader->good = false;
        reader->at = reader->size;
        return NULL;
    }
    const uint8_t *at = reader->bytes + reader->at;
    reader->at += size;
    return at;
}

uint8_t ivl_crtp_u8(ivl_crtp_reader_t *reader)
{
    const uint8_t *b = ivl_crtp_take(reader, 1);
    return (b != NULL) ? b[0] : 0u;
}

uint16_t ivl_crtp_u16(ivl_crtp_reader_t *reader)
{
    const uint8_t *b = ivl_crtp_take(reader, 2);
    return (b != NULL) ? (uint16_t)(b[0] | ((uint32_t)b[1] << 8)) : 0u;
}

uint32_t ivl_crtp_u32(ivl_crtp_reader_t *reader)
{
    const uint8_t *b = ivl_crtp_take(reader, 4);
    return (b != NULL) ? b[0] | ((uint32_t)b[1] << 8) | ((uint32_t)b[2] << 16) | ((uint32_t)b[3] << 24) : 0u;
}

int16_t ivl_crtp_i16(ivl_crtp_reader_t *reader)
{
    const uint16_t raw = ivl_crtp_u16(reader);
    int16_t        value;
    memcpy(&value, &raw, sizeof value);
    return value;
}

float ivl_crtp_f32(ivl_crtp_reader_t *reader)
{
    const uint32_t raw = ivl_crtp_u32(reader);
    float          value;
    memcpy(&value, &raw, sizeof value);
    return value;
}

const char *ivl_crtp_text(ivl_crtp_reader_t *reader)
{
    const uint8_t *begin = reader->bytes + reader->at;
    const uint8_t *zero = memchr(begin, 0, ivl_crtp_left(reader));
    if (zero == NULL)
    {
        reader->good = false;
        reader->at = reader->size;
        return NULL;
    }
    reader->at += (size_t)(zero - begin) + 1u;
    return (const char *)begin;
}

size_t ivl_crtp_left(const ivl_crtp_reader_t *reader)
{
    return reader->size - reader->at;
}

bool ivl_crtp_exact(const ivl_crtp_reader_t *reader)
{
    return reader->good && (ivl_crtp_left(reader) == 0u);
}
