/// @file ivl_port.h
/// Messages between a program on the chip that runs flight cores, and its host.
///
/// The chip greets once; then each request is answered by one reply.  All have a fixed size and carry the core's own structs as they lie in
/// memory: little-endian, and of the same layout on both sides, which the sizes in the greeting and a test on the debug information prove.
/// (Bare-metal compilers shorten enums by default; this one is told not to.)
#ifndef IVL_PORT_H
#define IVL_PORT_H
#include "ivl.h"

enum
{
    IVL_PORT_MAGIC = 0x31304c56,  ///< version 1
    IVL_PORT_SLOTS = 16           ///< flight cores on one chip
};

typedef enum
{
    IVL_PORT_INIT = 1,    ///< ivl_init with request.with.cfg
    IVL_PORT_COMMIT = 2,  ///< ivl_policy_commit with request.with.policy
    IVL_PORT_STEP = 3     ///< ivl_step with request.with.in
} ivl_port_operation_t;

typedef struct
{
    uint32_t magic;
    uint32_t n_slots;
    uint32_t request_size, reply_size;
    uint32_t cfg_size, state_size, in_size, out_size;
} ivl_port_hello_t;

typedef struct
{
    uint32_t operation;
    uint32_t slot;  ///< which core
    union
    {
        ivl_cfg_t    cfg;
        ivl_policy_t policy;
        ivl_in_t     in;
    } with;
} ivl_port_request_t;

typedef struct
{
    int32_t     status;     ///< of COMMIT, else 0
    uint32_t    n_request;  ///< of this slot since its last INIT, from 0: nothing was lost
    ivl_state_t state;      ///< after the operation
    ivl_out_t   out;        ///< of STEP, else zero
} ivl_port_reply_t;

_Static_assert(sizeof(ivl_phase_t) == 4u && sizeof(ivl_request_t) == 4u && sizeof(ivl_status_t) == 4u, "enums of 32 bits on both sides");
_Static_assert(sizeof(float) == 4u && sizeof(bool) == 1u && _Alignof(uint64_t) == 8u, "plain types alike on both sides");
_Static_assert(offsetof(ivl_port_request_t, with) == 8u, "no gap that one side could lack");

static inline ivl_port_hello_t ivl_port_hello(void)
{
    return (ivl_port_hello_t){IVL_PORT_MAGIC,
                              IVL_PORT_SLOTS,
                              (uint32_t)sizeof(ivl_port_request_t),
                              (uint32_t)sizeof(ivl_port_reply_t),
                              (uint32_t)sizeof(ivl_cfg_t),
                              (uint32_t)sizeof(ivl_state_t),
                              (uint32_t)sizeof(ivl_in_t),
                              (uint32_t)sizeof(ivl_out_t)};
}
#endif  // IVL_PORT_H
