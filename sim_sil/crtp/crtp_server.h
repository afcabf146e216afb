/// @file crtp_server.h
/// The CRTP server's memory, and what the files of its ports share.  Those who drive it see crtp_dispatch.h.
#ifndef IVL_CRTP_SERVER_H
#define IVL_CRTP_SERVER_H
#include "crtp_own.h"
#include "crtp_packet.h"
#include "crtp_toc.h"

enum
{
    IVL_CRTP_BLOCKS = 16,
    IVL_CRTP_LOG_VARIABLES = 128,
    IVL_CRTP_LOG_BYTES = 26,
    IVL_CRTP_VALUE_BYTES = 8  ///< of the largest parameter
};

/// A variable in a block.
typedef struct
{
    uint16_t id;
    uint8_t  fetch;  ///< type as sent: 1..7 as in the table, 8 half precision
} ivl_crtp_log_op_t;

typedef struct
{
    bool              used, started;
    uint8_t           id;
    uint8_t           n, n_bytes;
    ivl_crtp_log_op_t op[IVL_CRTP_LOG_BYTES];
    uint32_t          period_ms;
    uint64_t          next_ms;
} ivl_crtp_block_t;

typedef struct
{
    ivl_crtp_toc_t       toc;
    ivl_crtp_toc_item_t *items;
    ivl_cf_log_t        *rows;
    ivl_crtp_block_t     block[IVL_CRTP_BLOCKS];
    uint16_t             n_variables;
    uint64_t             next_ms;  ///< of all started blocks; UINT64_MAX if there are none
} ivl_crtp_logs_t;

typedef struct
{
    bool    stored;
    uint8_t start[IVL_CRTP_VALUE_BYTES];  ///< default
    uint8_t kept[IVL_CRTP_VALUE_BYTES];   ///< in persistent memory
    uint8_t told[IVL_CRTP_VALUE_BYTES];   ///< what clients take it to be
} ivl_crtp_param_state_t;

typedef struct
{
    ivl_crtp_toc_t          toc;
    ivl_crtp_toc_item_t    *items;
    ivl_cf_param_t         *rows;
    ivl_crtp_param_state_t *state;
    size_t                  n_vehicle;  ///< the first are the vehicle's, the others the server's own
    bool                    written;    ///< since they were compared with what clients take them to be
} ivl_crtp_params_t;

typedef struct ivl_crtp ivl_crtp_t;

/// What the server asks of the program around it.
typedef struct
{
    void *context;
    void (*send)(void *context, const ivl_crtp_packet_t *packet);  ///< to the client
    void (*own_changed)(void *context);  ///< a parameter of groups sil or fault that is the server's own was written; may be NULL
} ivl_crtp_host_t;

struct ivl_crtp
{
    ivl_cf_t         *cf;
    ivl_crtp_host_t   host;
    ivl_crtp_params_t params;
    ivl_crtp_logs_t   logs;
    ivl_crtp_own_t    own;
    uint8_t           address;         ///< last byte of the radio address: who is meant by packed poses
    bool              is_off;          ///< the vehicle has no power
    bool              ends_with_zero;  ///< the last command of the client was a set-point of zeros
    bool              holds_zero;      ///< it waits whether the client stays
    uint64_t          zero_until_ms;   ///< when it acts all the same, or, having acted, is handed back
    const uint8_t    *phase, *ended;
    uint8_t           last_phase, last_ended;
    bool              is_held;  ///< the answer to run_to_ms waits until it is reached
    ivl_crtp_packet_t held;
};

uint64_t ivl_crtp_time_ms(const ivl_crtp_t *crtp);

/// A packet to the client.
void ivl_crtp_send(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet);

/// Counts a packet that was malformed or refused.
void ivl_crtp_bad(ivl_crtp_t *crtp);
#endif  // IVL_CRTP_SERVER_H
