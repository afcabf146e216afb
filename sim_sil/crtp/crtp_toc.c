#include "crtp_toc.h"

#include <stdio.h>
#include <string.h>

#include "ivl_wire.h"

static bool good_name(const ivl_crtp_toc_item_t *item, char *error, size_t error_size)
{
    const size_t group = strlen(item->group);
    const size_t name = strlen(item->name);
    if ((group > 0u) && (name > 0u) && (group + name <= IVL_CRTP_NAME_MAX))
    {
        return true;
    }
    snprintf(error, error_size, "%s.%s: group and name have %zu characters (allowed 1 .. %d together)", item->group, item->name,
             group + name, IVL_CRTP_NAME_MAX);
    return false;
}

bool ivl_crtp_toc_init(ivl_crtp_toc_t *toc, uint8_t port, const ivl_crtp_toc_item_t *items, size_t n, char *error, size_t error_size)
{
    *toc = (ivl_crtp_toc_t){.port = port, .items = items};
    if (n >= UINT16_MAX)
    {
        snprintf(error, error_size, "a table of %zu items (allowed 0 .. %u)", n, UINT16_MAX - 1u);
        return false;
    }
    toc->crc = ivl_wire_crc(0, &port, 1);
    for (size_t i = 0; i < n; i++)
    {
        uint16_t twin;
        if (!good_name(&items[i], error, error_size))
        {
            return false;
        }
        if (ivl_crtp_toc_find(toc, items[i].group, items[i].name, &twin))
        {
            snprintf(error, error_size, "%s.%s: is in the table twice", items[i].group, items[i].name);
            return false;
        }
        toc->crc = ivl_wire_crc(toc->crc, &items[i].code, 1);
        toc->crc = ivl_wire_crc(toc->crc, items[i].group, strlen(items[i].group) + 1u);
        toc->crc = ivl_wire_crc(toc->crc, items[i].name, strlen(items[i].name) + 1u);
        toc->n++;
    }
    return true;
}

bool ivl_crtp_toc_find(const ivl_crtp_toc_t *toc, const char *group, const char *name, uint16_t *id)
{
    for (uint16_t i = 0; i < toc->n; i++)
    {
        const ivl_crtp_toc_item_t *item = &toc->items[i];
        // the first characters differ most often, and a comparison of texts is a call
        if ((item->name[0] == name[0]) && (item->group[0] == group[0]) && (strcmp(item->name, name) == 0) &&
            (strcmp(item->group, group) == 0))
        {
            *id = i;
            return true;
        }
    }
    return false;
}

static void put_item(const ivl_crtp_toc_t *toc, uint16_t id, ivl_crtp_packet_t *reply)
{
    ivl_crtp_put_u8(reply, IVL_CRTP_TOC_ITEM);
    if (id < toc->n)
    {
        ivl_crtp_put_u16(reply, id);
        ivl_crtp_put_u8(reply, toc->items[id].code);
        ivl_crtp_put_text(reply, toc->items[id].group);
        ivl_crtp_put_text(reply, toc->items[id].name);
    }
}

bool ivl_crtp_toc_answer(const ivl_crtp_toc_t *toc, const ivl_crtp_packet_t *request, ivl_crtp_packet_t *reply)
{
    ivl_crtp_reader_t r = ivl_crtp_read(request);
    const uint8_t     command = ivl_crtp_u8(&r);
    *reply = ivl_crtp_packet(toc->port, 0);
    if ((command == IVL_CRTP_TOC_INFO) && ivl_crtp_exact(&r))
    {
        ivl_crtp_put_u8(reply, command);
        ivl_crtp_put_u16(reply, toc->n);
        ivl_crtp_put_u32(reply, toc->crc);
        return true;
    }
    const uint16_t id = ivl_crtp_u16(&r);
    if ((command == IVL_CRTP_TOC_ITEM) && ivl_crtp_exact(&r))
    {
        put_item(toc, id, reply);
        return true;
    }
    return false;
}
