/// @file crtp_logs.c
/// Port 5: table and blocks.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "crtp_log_value.h"
#include "crtp_logs.h"

typedef enum
{
    DELETE = 2,
    START = 3,  ///< period in units of 10 ms
    STOP = 4,
    RESET = 5,
    CREATE_V2 = 6,
    APPEND_V2 = 7,
    START_V2 = 8  ///< period in ms
} command_t;

// ---- table

bool ivl_crtp_logs_open(ivl_crtp_t *crtp, char *error, size_t error_size)
{
    ivl_crtp_logs_t    *l = &crtp->logs;
    size_t              n_vehicle;
    const ivl_cf_log_t *vehicle = ivl_cf_logs(crtp->cf, &n_vehicle);
    const size_t        n = n_vehicle + ivl_crtp_own_logs(&crtp->own, NULL);
    l->rows = calloc(n, sizeof *l->rows);
    l->items = calloc(n, sizeof *l->items);
    if ((l->rows == NULL) || (l->items == NULL))
    {
        snprintf(error, error_size, "out of memory for %zu log variables", n);
        return false;
    }
    memcpy(l->rows, vehicle, n_vehicle * sizeof *l->rows);
    (void)ivl_crtp_own_logs(&crtp->own, l->rows + n_vehicle);
    for (size_t i = 0; i < n; i++)
    {
        const ivl_cf_log_t *row = &l->rows[i];
        if ((ivl_crtp_log_size(row->type) == 0u) || (row->type > IVL_CF_LOG_F32))
        {
            snprintf(error, error_size, "log variable %s.%s: type 0x%02x is unknown", row->group, row->name, row->type);
            return false;
        }
        l->items[i] = (ivl_crtp_toc_item_t){row->group, row->name, row->type};
    }
    ivl_crtp_logs_reset(crtp);
    return ivl_crtp_toc_init(&l->toc, IVL_CRTP_PORT_LOG, l->items, n, error, error_size);
}

void ivl_crtp_logs_close(ivl_crtp_t *crtp)
{
    free(crtp->logs.rows);
    free(crtp->logs.items);
    memset(&crtp->logs, 0, sizeof crtp->logs);
}

// ---- blocks

static ivl_crtp_block_t *find(ivl_crtp_logs_t *logs, uint8_t id)
{
    for (int i = 0; i < IVL_CRTP_BLOCKS; i++)
    {
        if (logs->block[i].used && (logs->block[i].id == id))
        {
            return &logs->block[i];
        }
    }
    return NULL;
}

static ivl_crtp_block_t *find_free(ivl_crtp_logs_t *logs)
{
    for (int i = 0; i < IVL_CRTP_BLOCKS; i++)
    {
        if (!logs->block[i].used)
        {
            return &logs->block[i];
        }
    }
    return NULL;
}

static void plan_next(ivl_crtp_logs_t *logs)
{
    logs->next_ms = UINT64_MAX;
    for (int i = 0; i < IVL_CRTP_BLOCKS; i++)
    {
        const ivl_crtp_block_t *b = &logs->block[i];
        if (b->used && b->started && (b->next_ms < logs->next_ms))
        {
            logs->next_ms = b->next_ms;
        }
    }
}

void ivl_crtp_logs_reset(ivl_crtp_t *crtp)
{
    memset(crtp->logs.block, 0, sizeof crtp->logs.block);
    crtp->logs.n_variables = 0;
    crtp->logs.next_ms = UINT64_MAX;
}

// Variables are added all or none.  A byte that is left over behind the last one is a habit of a client, and means nothing.
static ivl_crtp_error_t append(ivl_crtp_logs_t *logs, ivl_crtp_block_t *block, ivl_crtp_reader_t *r)
{
    ivl_crtp_block_t grown = *block;
    while (ivl_crtp_left(r) >= 3u)
    {
        const uint8_t  fetch = ivl_crtp_u8(r) & 0x0Fu;
        const uint16_t id = ivl_crtp_u16(r);
        const size_t   size = ivl_crtp_log_size(fetch);
        if ((id >= logs->toc.n) || (size == 0u))
        {
            return IVL_CRTP_ENOENT;
        }
        if (grown.n_bytes + size > IVL_CRTP_LOG_BYTES)
        {
            return IVL_CRTP_E2BIG;
        }
        if (logs->n_variables + (grown.n - block->n) >= IVL_CRTP_LOG_VARIABLES)
        {
            return IVL_CRTP_ENOMEM;
        }
        grown.op[grown.n++] = (ivl_crtp_log_op_t){id, fetch};
        grown.n_bytes = (uint8_t)(grown.n_bytes + size);
    }
    logs->n_variables = (uint16_t)(logs->n_variables + (grown.n - block->n));
    *block = grown;
    return IVL_CRTP_OK;
}

static ivl_crtp_error_t create(ivl_crtp_logs_t *logs, uint8_t id, ivl_crtp_reader_t *r)
{
    if (find(logs, id) != NULL)
    {
        return IVL_CRTP_EEXIST;
    }
    ivl_crtp_block_t *block = find_free(logs);
    if (block == NULL)
    {
        return IVL_CRTP_ENOMEM;
    }
    *block = (ivl_crtp_block_t){.id = id};
    const ivl_crtp_error_t error = append(logs, block, r);
    block->used = error == IVL_CRTP_OK;
    return error;
}

static void sample(ivl_crtp_t *crtp, const ivl_crtp_block_t *block)
{
    const uint32_t    t_ms = (uint32_t)ivl_crtp_time_ms(crtp);
    ivl_crtp_packet_t packet = ivl_crtp_packet(IVL_CRTP_PORT_LOG, 2);
    ivl_crtp_put_u8(&packet, block->id);
    ivl_crtp_put_u8(&packet, (uint8_t)t_ms);
    ivl_crtp_put_u8(&packet, (uint8_t)(t_ms >> 8));
    ivl_crtp_put_u8(&packet, (uint8_t)(t_ms >> 16));
    for (int i = 0; i < block->n; i++)
    {
        uint8_t      bytes[4];
        const size_t size = ivl_crtp_log_value(&crtp->logs.rows[block->op[i].id], block->op[i].fetch, bytes);
        ivl_crtp_put_bytes(&packet, bytes, size);
    }
    ivl_crtp_send(crtp, &packet);
}

// a period of 0 means once, now
static void start(ivl_crtp_t *crtp, ivl_crtp_block_t *block, uint32_t period_ms)
{
    if (period_ms == 0u)
    {
        ivl_cf_logs_refresh(crtp->cf);
        sample(crtp, block);
        return;
    }
    block->started = true;
    block->period_ms = period_ms;
    block->next_ms = ivl_crtp_time_ms(crtp) + period_ms;
}

static void delete_block(ivl_crtp_logs_t *logs, ivl_crtp_block_t *block)
{
    logs->n_variables = (uint16_t)(logs->n_variables - block->n);
    *block = (ivl_crtp_block_t){.used = false};
}

// ---- packets

static ivl_crtp_error_t control_block(ivl_crtp_t *crtp, command_t command, ivl_crtp_block_t *block, ivl_crtp_reader_t *r)
{
    uint32_t period_ms = 0;
    if (command == APPEND_V2)
    {
        return append(&crtp->logs, block, r);
    }
    if (command == START)
    {
        period_ms = 10u * ivl_crtp_u8(r);
    }
    else if (command == START_V2)
    {
        period_ms = ivl_crtp_u16(r);
    }
    if (!ivl_crtp_exact(r))
    {
        ivl_crtp_bad(crtp);
        return IVL_CRTP_EINVAL;
    }
    if (command == DELETE)
    {
        delete_block(&crtp->logs, block);
    }
    else if (command == STOP)
    {
        block->started = false;
    }
    else
    {
        start(crtp, block, period_ms);
    }
    return IVL_CRTP_OK;
}

static ivl_crtp_error_t control(ivl_crtp_t *crtp, uint8_t command, uint8_t id, ivl_crtp_reader_t *r)
{
    if (command == RESET)
    {
        ivl_crtp_logs_reset(crtp);
        return IVL_CRTP_OK;
    }
    if (!r->good)
    {
        ivl_crtp_bad(crtp);
        return IVL_CRTP_EINVAL;
    }
    if (command == CREATE_V2)
    {
        return create(&crtp->logs, id, r);
    }
    if ((command < DELETE) || (command > START_V2))
    {
        return IVL_CRTP_ENOEXEC;
    }
    ivl_crtp_block_t *block = find(&crtp->logs, id);
    return (block == NULL) ? IVL_CRTP_ENOENT : control_block(crtp, (command_t)command, block, r);
}

static void handle_control(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet)
{
    ivl_crtp_reader_t r = ivl_crtp_read(packet);
    const uint8_t     command = ivl_crtp_u8(&r);
    if (!r.good)
    {
        ivl_crtp_bad(crtp);
        return;
    }
    const uint8_t          id = ivl_crtp_u8(&r);
    const ivl_crtp_error_t error = control(crtp, command, id, &r);
    plan_next(&crtp->logs);
    ivl_crtp_packet_t reply = ivl_crtp_packet(IVL_CRTP_PORT_LOG, 1);
    ivl_crtp_put_u8(&reply, command);
    ivl_crtp_put_u8(&reply, id);
    ivl_crtp_put_u8(&reply, (uint8_t)error);
    ivl_crtp_send(crtp, &reply);
}

void ivl_crtp_logs_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet)
{
    ivl_crtp_packet_t reply;
    if (packet->channel == 1u)
    {
        handle_control(crtp, packet);
    }
    else if ((packet->channel == 0u) && ivl_crtp_toc_answer(&crtp->logs.toc, packet, &reply))
    {
        if (reply.data[0] == IVL_CRTP_TOC_INFO)
        {
            ivl_crtp_put_u8(&reply, IVL_CRTP_BLOCKS);
            ivl_crtp_put_u8(&reply, IVL_CRTP_LOG_VARIABLES);
        }
        ivl_crtp_send(crtp, &reply);
    }
    else
    {
        ivl_crtp_bad(crtp);
    }
}

void ivl_crtp_logs_step(ivl_crtp_t *crtp)
{
    const uint64_t now_ms = ivl_crtp_time_ms(crtp);
    if (now_ms < crtp->logs.next_ms)
    {
        return;
    }
    ivl_cf_logs_refresh(crtp->cf);
    for (int i = 0; i < IVL_CRTP_BLOCKS; i++)
    {
        ivl_crtp_block_t *block = &crtp->logs.block[i];
        if (block->used && block->started && (now_ms >= block->next_ms))
        {
            block->next_ms += block->period_ms;
            sample(crtp, block);
        }
    }
    plan_next(&crtp->logs);
}
