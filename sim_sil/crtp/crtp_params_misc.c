/// @file crtp_params_misc.c
/// Port 2, channel 3: set by name, extended types, defaults and persistent values.
#include <string.h>

#include "crtp_server.h"

typedef enum
{
    SET_BY_NAME = 0,
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
        ivl_crtp_params_hold(crtp, &reply);
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
    default:
        return IVL_CRTP_ENOEXEC;
    }
    return IVL_CRTP_OK;
}

void ivl_crtp_params_misc(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet)
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
