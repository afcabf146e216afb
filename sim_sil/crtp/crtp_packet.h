/// @file crtp_packet.h
/// A CRTP packet, and the only two ways in which this server touches its bytes: a reader that cannot leave them and a writer that cannot
/// overrun them.  Little-endian, no alignment.
#ifndef IVL_CRTP_PACKET_H
#define IVL_CRTP_PACKET_H
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum
{
    IVL_CRTP_PAYLOAD_MAX = 30,
    IVL_CRTP_BYTES_MAX = IVL_CRTP_PAYLOAD_MAX + 1,  ///< with the header
    IVL_CRTP_NULL_HEADER = 0xFF                     ///< port 15, channel 3: a packet that says nothing
};

typedef enum
{
    IVL_CRTP_PORT_CONSOLE = 0,
    IVL_CRTP_PORT_PARAM = 2,
    IVL_CRTP_PORT_COMMANDER = 3,
    IVL_CRTP_PORT_MEMORY = 4,
    IVL_CRTP_PORT_LOG = 5,
    IVL_CRTP_PORT_LOCALIZATION = 6,
    IVL_CRTP_PORT_GENERIC = 7,
    IVL_CRTP_PORT_HIGH_LEVEL = 8,
    IVL_CRTP_PORT_SUPERVISOR = 9,
    IVL_CRTP_PORT_PLATFORM = 13,
    IVL_CRTP_PORT_LINK = 15,
    IVL_CRTP_PORT_COUNT = 16
} ivl_crtp_port_t;

/// Error numbers on the wire; those of the vehicle's C library, whatever this machine's are.
typedef enum
{
    IVL_CRTP_OK = 0,
    IVL_CRTP_ENOENT = 2,
    IVL_CRTP_EIO = 5,
    IVL_CRTP_E2BIG = 7,
    IVL_CRTP_ENOEXEC = 8,
    IVL_CRTP_ENOMEM = 12,
    IVL_CRTP_EACCES = 13,
    IVL_CRTP_EEXIST = 17,
    IVL_CRTP_EINVAL = 22
} ivl_crtp_error_t;

typedef struct
{
    uint8_t port;     ///< 0..15
    uint8_t channel;  ///< 0..3
    uint8_t size;     ///< of the payload, 0..30
    uint8_t data[IVL_CRTP_PAYLOAD_MAX];
} ivl_crtp_packet_t;

/// @return false if there is no header or more than 31 bytes
bool ivl_crtp_parse(ivl_crtp_packet_t *packet, const uint8_t *bytes, size_t size);

/// @param[out] bytes  at least IVL_CRTP_BYTES_MAX
/// @return how many
size_t ivl_crtp_bytes(const ivl_crtp_packet_t *packet, uint8_t *bytes);

/// Header without payload.
ivl_crtp_packet_t ivl_crtp_packet(uint8_t port, uint8_t channel);

// ---- writing: what does not fit is left out as a whole, which is a programming error and stops a build with assertions

void ivl_crtp_put_u8(ivl_crtp_packet_t *packet, uint8_t value);
void ivl_crtp_put_u16(ivl_crtp_packet_t *packet, uint16_t value);
void ivl_crtp_put_u32(ivl_crtp_packet_t *packet, uint32_t value);
void ivl_crtp_put_bytes(ivl_crtp_packet_t *packet, const void *bytes, size_t size);

/// Text with its closing zero.
void ivl_crtp_put_text(ivl_crtp_packet_t *packet, const char *text);

// ---- reading: past the end every value is 0 and `good` turns false, so that a decoder reads all and asks once

typedef struct
{
    const uint8_t *bytes;
    size_t         size, at;
    bool           good;
} ivl_crtp_reader_t;

ivl_crtp_reader_t ivl_crtp_read(const ivl_crtp_packet_t *packet);

uint8_t        ivl_crtp_u8(ivl_crtp_reader_t *reader);
uint16_t       ivl_crtp_u16(ivl_crtp_reader_t *reader);
uint32_t       ivl_crtp_u32(ivl_crtp_reader_t *reader);
int16_t        ivl_crtp_i16(ivl_crtp_reader_t *reader);
float          ivl_crtp_f32(ivl_crtp_reader_t *reader);
const uint8_t *ivl_crtp_take(ivl_crtp_reader_t *reader, size_t size);  ///< NULL if there are fewer

/// Text up to and with its zero; NULL if there is no zero.
const char *ivl_crtp_text(ivl_crtp_reader_t *reader);

size_t ivl_crtp_left(const ivl_crtp_reader_t *reader);

/// All that was asked for was there, and nothing more.
bool ivl_crtp_exact(const ivl_crtp_reader_t *reader);
#endif  // IVL_CRTP_PACKET_H
