/// @file serve.h
/// The flight cores of this chip, driven by messages.
#ifndef SERVE_H
#define SERVE_H
#include "ivl_port.h"

typedef struct
{
    ivl_cfg_t   cfg;
    ivl_state_t state;
    uint32_t    n_request;
    bool        started;
} serve_core_t;

typedef void (*serve_step_t)(const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_in_t *in, ivl_out_t *out);

/// Carry out one request; one that makes no sense ends the program with EXIT_PROTOCOL.
/// @param[in] step  ivl_step, or something around it
void serve_request(serve_core_t cores[IVL_PORT_SLOTS], serve_step_t step, const ivl_port_request_t *request, ivl_port_reply_t *reply);
#endif  // SERVE_H
