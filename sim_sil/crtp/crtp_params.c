/// @file crtp_params.c
/// Port 2: table, reading, writing; by channel 3 also set by name, extended types, defaults and persistent values.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "crtp_params.h"

enum
{
    LOOK_MS = 100,  // so often the vehicle's own changes are looked for; what follows from a write is told at once
    CODE_EXTENDED = 0x10,
    CODE_CORE = 0x20,
    CODE_READ_ONLY = 0x40
};

size_t ivl_crtp_param_size(uint8_t type)
{
    static const uint8_t SIZE[] = {
        [IVL_CF_PARAM_I8] = 1,  [IVL_CF_PARAM_I16] = 2, [IVL_CF_PARAM_I32] = 4, [IVL_CF_PARAM_I64] = 8, [IVL_CF_PARAM_F32] = 4,
        [IVL_CF_PARAM_F64] = 8, [IVL_CF_PARAM_U8] = 1,  [IVL_CF_PARAM_U16] = 2, [IVL_CF_PARAM_U32] = 4, [IVL_CF_PARAM_U64] = 8,
    };
    return (type < sizeof SIZE) ? SIZE[type] : 0u;
}

static uint8_t code_of(const ivl_cf_param_t *row)
{
    return (uint8_t)(row->type | (row->persistent ? CODE_EXTENDED : 0) | (row->core ? CODE_CORE : 0) |
                     (row->read_only ? CODE_READ_ONLY : 0));
}

bool ivl_crtp_params_open(ivl_crtp_t *crtp, char *error, size_t error_size)
{
    ivl_crtp_params_t    *p = &crtp->params;
    const ivl_cf_param_t *vehicle = ivl_cf_params(crtp->cf, &p->n_vehicle);
    const size_t          n = p->n_vehicle + ivl_crtp_own_params(&crtp->own, NULL);
    p->rows = calloc(n, sizeof *p->rows);
    p->items = calloc(n, sizeof *p->items);
    p->state = calloc(n, sizeof *p->state);
    if ((p->rows == NULL) || (p->items == NULL) || (p->state == NULL))
    {
        snprintf(error, error_size, "out of memory for %zu parameters", n);
        return false;
    }
    memcpy(p->rows, vehicle, p->n_vehicle * sizeof *p->rows);
    (void)ivl_crtp_own_params(&crtp->own, p->rows + p->n_vehicle);
    for (size_t i = 0; i < n; i++)
    {
        const ivl_cf_param_t *row = &p->rows[i];
        if (ivl_crtp_param_size(row->type) == 0u)
        {
            snprintf(error, error_size, "parameter %s.%s: type 0x%02x is unknown", row->group, row->name, row->type);
            return false;
        }
        p->items[i] = (ivl_crtp_toc_item_t){row->group, row->name, code_of(row)};
    }
    const bool good = ivl_crtp_toc_init(&p->toc, IVL_CRTP_PORT_PARAM, p->items, n, error, error_size);
    ivl_crtp_params_take_defaults(crtp);
    return good;
}

void ivl_crtp_params_take_defaults(ivl_crtp_t *crtp)
{
    for (uint16_t i = 0; i < crtp->params.toc.n; i++)
    {
        const ivl_cf_param_t *row = &crtp->params.rows[i];
        memcpy(crtp->params.state[i].start, row->address, ivl_crtp_param_size(row->type));
    }
    ivl_crtp_params_forget(crtp);
}

void ivl_crtp_params_forget(ivl_crtp_t *crtp)
{
    for (uint16_t i = 0; i < crtp->params.toc.n; i++)
    {
        const ivl_cf_param_t *row = &crtp->params.rows[i];
        memcpy(crtp->params.state[i].told, row->address, ivl_crtp_param_size(row->type));
    }
}

void ivl_crtp_params_restore(ivl_crtp_t *crtp)
{
    for (uint16_t i = 0; i < crtp->params.toc.n; i++)
    {
        if (crtp->params.state[i].stored)
        {
            (void)ivl_crtp_params_write(crtp, i, crtp->params.state[i].kept);
        }
    }
}

void ivl_crtp_params_close(ivl_crtp_t *crtp)
{
    free(crtp->params.rows);
    free(crtp->params.items);
    free(crtp->params.state);
    memset(&crtp->params, 0, sizeof crtp->params);
}

static bool is_run_to(const ivl_crtp_t *crtp, uint16_t id)
{
    return crtp->params.rows[id].address == &crtp->own.time.run_to_ms;
}

// time starts anew from where the vehicle is, whichever way it goes from now on
static void time_changed(ivl_crtp_t *crtp)
{
    const uint64_t vehicle_us = ivl_cf_time_us(crtp->cf);
    ivl_crtp_time_restart(&crtp->own.time);
    ivl_crtp_time_stop(&crtp->own.time, vehicle_us);
    crtp->own.time.asked_ms = crtp->own.time.run_to_ms;
    if (crtp->is_held)
    {
        crtp->is_held = false;
        ivl_crtp_send(crtp, &crtp->held);
    }
}

static bool own_written(ivl_crtp_t *crtp, uint16_t id)
{
    ivl_crtp_time_t *time = &crtp->own.time;
    const void      *address = crtp->params.rows[id].address;
    ivl_crtp_own_clamp(&crtp->own);
    if ((address == &time->lockstep) || (address == &time->speed_factor))
    {
        time_changed(crtp);
    }
    const bool waits = is_run_to(crtp, id) && ivl_crtp_time_ask(time, ivl_cf_time_us(crtp->cf));
    if (crtp->host.own_changed != NULL)
    {
        crtp->host.own_changed(crtp->host.context);
    }
    return waits;
}

bool ivl_crtp_params_write(ivl_crtp_t *crtp, uint16_t id, const uint8_t *value)
{
    const ivl_cf_param_t *row = &crtp->params.rows[id];
    memcpy(row->address, value, ivl_crtp_param_size(row->type));
    memcpy(crtp->params.state[id].told, value, ivl_crtp_param_size(row->type));
    crtp->params.written = true;
    if (id >= crtp->params.n_vehicle)
    {
        return own_written(crtp, id);
    }
    if (row->changed != NULL)
    {
        row->changed();
    }
    return false;
}

static void answer_error(ivl_crtp_t *crtp, uint8_t channel, uint16_t id, ivl_crtp_error_t error)
{
    ivl_crtp_packet_t reply = ivl_crtp_packet(IVL_CRTP_PORT_PARAM, channel);
    ivl_crtp_put_u16(&reply, id);
    ivl_crtp_put_u8(&reply, (uint8_t)error);
    ivl_crtp_send(crtp, &reply);
}

static void handle_read(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet)
{
    ivl_crtp_reader_t r = ivl_crtp_read(packet);
    const uint16_t    id = ivl_crtp_u16(&r);
    if (!ivl_crtp_exact(&r))
    {
        ivl_crtp_bad(crtp);
        return;
    }
    if (id >= crtp->params.toc.n)
    {
        answer_error(crtp, 1, id, IVL_CRTP_ENOENT);
        return;
    }
    const ivl_cf_param_t *row = &crtp->params.rows[id];
    ivl_crtp_packet_t     reply = ivl_crtp_packet(IVL_CRTP_PORT_PARAM, 1);
    ivl_crtp_put_u16(&reply, id);
    ivl_crtp_put_u8(&reply, IVL_CRTP_OK);
    ivl_crtp_put_bytes(&reply, row->address, ivl_crtp_param_size(row->type));
    ivl_crtp_send(crtp, &reply);
}

// The answer to run_to_ms waits until the vehicle is there.  A repetition of the request gets no second answer; another request ends the wait.
static void hold(ivl_crtp_t *crtp, const ivl_crtp_packet_t *reply)
{
    const bool is_same = (crtp->held.channel == reply->channel) && (crtp->held.size == reply->size) &&
                         (memcmp(crtp->held.data, reply->data, reply->size) == 0);
    if (crtp->is_held && !is_same)
    {
        ivl_crtp_send(crtp, &crtp->held);
    }
    crtp->is_held = true;
    crtp->held = *reply;
}

static void handle_write(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet)
{
    ivl_crtp_reader_t r = ivl_crtp_read(packet);
    const uint16_t    id = ivl_crtp_u16(&r);
    if (!r.good)
    {
        ivl_crtp_bad(crtp);
        return;
    }
    if (id >= crtp->params.toc.n)
    {
        answer_error(crtp, 2, id, IVL_CRTP_ENOENT);
        return;
    }
    const ivl_cf_param_t *row = &crtp->params.rows[id];
    const uint8_t        *value = ivl_crtp_take(&r, ivl_crtp_param_size(row->type));
    if (!ivl_crtp_exact(&r))
    {
        ivl_crtp_bad(crtp);
        answer_error(crtp, 2, id, IVL_CRTP_EINVAL);
        return;
    }
    if (row->read_only)
    {
        return;
    }
    if (ivl_crtp_params_write(crtp, id, value))
    {
        hold(crtp, packet);
        return;
    }
    // what was brought into range is seen in the answer
    ivl_crtp_packet_t reply = ivl_crtp_packet(IVL_CRTP_PORT_PARAM, 2);
    ivl_crtp_put_u16(&reply, id);
    ivl_crtp_put_bytes(&reply, (id < crtp->params.n_vehicle) || is_run_to(crtp, id) ? value : row->address, ivl_crtp_param_size(row->type));
    ivl_crtp_send(crtp, &reply);
}

// ---- channel 3

typedef enum
{
    SET_BY_NAME = 0,
    VALUE_CHANGED = 1,
    EXTENDED_TYPE = 2,
    STORE = 3,
    GET_STATE = 4,
    CLEAR = 5,
    DEFAULT_VALUE = 6,
    EXTENDED_TYPE_V2 = 7,
    DEFAULT_VALUE_V2 = 8
} command_t;

#define EXTENDED_PERSISTENT 1u

static ivl_crtp_error_t try_set(ivl_crtp_t *crtp, const char *group, const char *name, uint8_t type, ivl_crtp_reader_t *r, bool *waits)
{
    uint16_t id;
    if (!ivl_crtp_toc_find(&crtp->params.toc, group, name, &id))
    {
        return IVL_CRTP_ENOENT;
    }
    const ivl_cf_param_t *row = &crtp->params.rows[id];
    const uint8_t        *value = ivl_crtp_take(r, ivl_crtp_param_size(row->type));
    if ((type != row->type) || !ivl_crtp_exact(r))
    {
        return IVL_CRTP_EINVAL;
    }
    if (row->read_only)
    {
        return IVL_CRTP_EACCES;
    }
    *waits = ivl_crtp_params_write(crtp, id, value);
    return IVL_CRTP_OK;
}

static void set_by_name(ivl_crtp_t *crtp, ivl_crtp_reader_t *r)
{
    const char   *group = ivl_crtp_text(r);
    const char   *name = (group != NULL) ? ivl_crtp_text(r) : NULL;
    const uint8_t type = ivl_crtp_u8(r);
    // names beyond what a table can hold would also leave no room for the answer's error byte
    if (!r->good || (strlen(group) + strlen(name) > IVL_CRTP_NAME_MAX))
    {
        ivl_crtp_bad(crtp);
        return;
    }
    ivl_crtp_packet_t reply = ivl_crtp_packet(IVL_CRTP_PORT_PARAM, 3);
    ivl_crtp_put_u8(&reply, SET_BY_NAME);
    ivl_crtp_put_text(&reply, group);
    ivl_crtp_put_text(&reply, name);
    bool waits = false;
    ivl_crtp_put_u8(&reply, (uint8_t)try_set(crtp, group, name, type, r, &waits));
    if (waits)
    {
        hold(crtp, &reply);
        return;
    }
    ivl_crtp_send(crtp, &reply);
}

// in the older forms of two requests an error cannot be told from a value of 2
static ivl_crtp_error_t answer(ivl_crtp_t *crtp, command_t command, uint16_t id, ivl_crtp_packet_t *reply)
{
    ivl_crtp_param_state_t *state = &crtp->params.state[id];
    const ivl_cf_param_t   *row = &crtp->params.rows[id];
    const size_t            size = ivl_crtp_param_size(row->type);
    const bool              wants_writable = (command == DEFAULT_VALUE) || (command == DEFAULT_VALUE_V2);
    if (wants_writable ? row->read_only : !row->persistent)
    {
        return IVL_CRTP_ENOENT;
    }
    switch (command)
    {
    case EXTENDED_TYPE_V2:
        ivl_crtp_put_u8(reply, IVL_CRTP_OK);
        ivl_crtp_put_u8(reply, EXTENDED_PERSISTENT);
        break;
    case EXTENDED_TYPE:
        ivl_crtp_put_u8(reply, EXTENDED_PERSISTENT);
        break;
    case DEFAULT_VALUE_V2:
        ivl_crtp_put_u8(reply, IVL_CRTP_OK);
        ivl_crtp_put_bytes(reply, state->start, size);
        break;
    case DEFAULT_VALUE:
        ivl_crtp_put_bytes(reply, state->start, size);
        break;
    case GET_STATE:
        ivl_crtp_put_u8(reply, state->stored ? 1 : 0);
        ivl_crtp_put_bytes(reply, state->start, size);
        ivl_crtp_put_bytes(reply, state->kept, state->stored ? size : 0u);
        break;
    case STORE:
        memcpy(state->kept, row->address, size);
        state->stored = true;
        ivl_crtp_put_u8(reply, IVL_CRTP_OK);
        break;
    case CLEAR:
        if (!state->stored)
        {
            return IVL_CRTP_ENOENT;
        }
        state->stored = false;
        ivl_crtp_put_u8(reply, IVL_CRTP_OK);
        break;
    case SET_BY_NAME:
    case VALUE_CHANGED:
    default:
        return IVL_CRTP_ENOEXEC;
    }
    return IVL_CRTP_OK;
}

static void handle_misc(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet)
{
    ivl_crtp_reader_t r = ivl_crtp_read(packet);
    const uint8_t     command = ivl_crtp_u8(&r);
    if (r.good && (command == SET_BY_NAME))
    {
        set_by_name(crtp, &r);
        return;
    }
    const uint16_t id = ivl_crtp_u16(&r);
    if (!ivl_crtp_exact(&r) || (command < EXTENDED_TYPE) || (command > DEFAULT_VALUE_V2))
    {
        ivl_crtp_bad(crtp);
        return;
    }
    ivl_crtp_packet_t reply = ivl_crtp_packet(IVL_CRTP_PORT_PARAM, 3);
    ivl_crtp_put_u8(&reply, command);
    ivl_crtp_put_u16(&reply, id);
    const ivl_crtp_error_t error = (id < crtp->params.toc.n) ? answer(crtp, (command_t)command, id, &reply) : IVL_CRTP_ENOENT;
    if (error != IVL_CRTP_OK)
    {
        ivl_crtp_put_u8(&reply, (uint8_t)error);
    }
    ivl_crtp_send(crtp, &reply);
}

// ---- the port

void ivl_crtp_params_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet)
{
    ivl_crtp_packet_t reply;
    switch (packet->channel)
    {
    case 0:
        if (ivl_crtp_toc_answer(&crtp->params.toc, packet, &reply))
        {
            ivl_crtp_send(crtp, &reply);
        }
        else
        {
            ivl_crtp_bad(crtp);
        }
        break;
    case 1:
        handle_read(crtp, packet);
        break;
    case 2:
        handle_write(crtp, packet);
        break;
    default:
        handle_misc(crtp, packet);
        break;
    }
}

static void tell(ivl_crtp_t *crtp, uint16_t id)
{
    const ivl_cf_param_t *row = &crtp->params.rows[id];
    ivl_crtp_packet_t     event = ivl_crtp_packet(IVL_CRTP_PORT_PARAM, 3);
    ivl_crtp_put_u8(&event, VALUE_CHANGED);
    ivl_crtp_put_u16(&event, id);
    ivl_crtp_put_bytes(&event, row->address, ivl_crtp_param_size(row->type));
    ivl_crtp_send(crtp, &event);
}

void ivl_crtp_params_step(ivl_crtp_t *crtp)
{
    ivl_crtp_params_t *p = &crtp->params;
    if (!p->written && (ivl_crtp_time_ms(crtp) % LOOK_MS != 0u))
    {
        return;
    }
    p->written = false;
    for (uint16_t i = 0; i < p->toc.n; i++)
    {
        const size_t size = ivl_crtp_param_size(p->rows[i].type);
        if (memcmp(p->state[i].told, p->rows[i].address, size) != 0)
        {
            memcpy(p->state[i].told, p->rows[i].address, size);
            tell(crtp, i);
        }
    }
}
