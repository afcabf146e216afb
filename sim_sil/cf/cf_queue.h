/// @file cf_queue.h
/// What waits between vehicle and server: text, packets of the app channel.
#ifndef IVL_CF_QUEUE_H
#define IVL_CF_QUEUE_H
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum
{
    IVL_CF_TEXT_MAX = 2048,
    IVL_CF_PACKETS_MAX = 64,  ///< out; in there are as many as the firmware has
    IVL_CF_PACKETS_IN_MAX = 10
};

/// Bytes in order; what does not fit is left out.
typedef struct
{
    char   bytes[IVL_CF_TEXT_MAX];
    size_t first, n;
} ivl_cf_text_t;

void   ivl_cf_text_put(ivl_cf_text_t *text, const char *bytes);
size_t ivl_cf_text_take(ivl_cf_text_t *text, char *bytes, size_t size);

typedef struct
{
    uint8_t bytes[30];
    uint8_t size;
} ivl_cf_packet_t;

typedef struct
{
    ivl_cf_packet_t packet[IVL_CF_PACKETS_MAX];
    size_t          first, n, most;  ///< most <= IVL_CF_PACKETS_MAX
} ivl_cf_packets_t;

/// @return false if the queue is full or the packet is too long
bool ivl_cf_packets_put(ivl_cf_packets_t *queue, const void *bytes, size_t size);

/// @return size of the packet, 0 if there is none; what exceeds `size` is cut off
size_t ivl_cf_packets_take(ivl_cf_packets_t *queue, void *bytes, size_t size);

#endif  // IVL_CF_QUEUE_H
