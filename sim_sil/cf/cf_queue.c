#include "cf_queue.h"

#include <string.h>

void ivl_cf_text_put(ivl_cf_text_t *text, const char *bytes)
{
    for (; *bytes != '\0' && text->n < IVL_CF_TEXT_MAX; bytes++)
    {
        text->bytes[(text->first + text->n++) % IVL_CF_TEXT_MAX] = *bytes;
    }
}

size_t ivl_cf_text_take(ivl_cf_text_t *text, char *bytes, size_t size)
{
    size_t n = 0;
    for (; n < size && text->n > 0; n++, text->n--)
    {
        bytes[n] = text->bytes[text->first];
        text->first = (text->first + 1) % IVL_CF_TEXT_MAX;
    }
    return n;
}

bool ivl_cf_packets_put(ivl_cf_packets_t *queue, const void *bytes, size_t size)
{
    if (size == 0 || size > sizeof queue->packet[0].bytes || queue->n >= queue->most)
    {
        return false;
    }
    ivl_cf_packet_t *packet = &queue->packet[(queue->first + queue->n++) % IVL_CF_PACKETS_MAX];
    memcpy(packet->bytes, bytes, size);
    packet->size = (uint8_t)size;
    return true;
}

size_t ivl_cf_packets_take(ivl_cf_packets_t *queue, void *bytes, size_t size)
{
    if (queue->n == 0)
    {
        return 0;
    }
    const ivl_cf_packet_t *packet = &queue->packet[queue->first];
    const size_t           n = (packet->size < size) ? packet->size : size;
    memcpy(bytes, packet->bytes, n);
    queue->first = (queue->first + 1) % IVL_CF_PACKETS_MAX;
    queue->n--;
    return n;
}
