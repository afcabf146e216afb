/// @file crtp_server.h
/// The CRTP server: bytes in, calls of the vehicle, bytes out.  It knows neither sockets nor the wall clock, so that tests and a fuzzer can
/// drive it alone.  Protocol version 12.
///
/// Rule for lengths: a packet has exactly the bytes of its table in docs/SIL.md.  Any other is counted (log sil.n_bad) and changes nothing;
/// it is answered with EINVAL where the table has an error byte.  Longer requests are taken only where clients are known to send them: log
/// blocks (a stray byte), link service, version.
#ifndef IVL_CRTP_SERVER_H
#define IVL_CRTP_SERVER_H
#include "cf/cf.h"
#include "crtp_faults.h"
#include "crtp_packet.h"
#include "crtp_time.h"
#include "crtp_toc.h"

#define IVL_CRTP_VERSION 12u

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
} ivl_crtp_param_state_t;

typedef struct
{
    ivl_crtp_toc_t          toc;
    ivl_crtp_toc_item_t    *items;
    ivl_cf_param_t         *rows;
    ivl_crtp_param_state_t *state;
    size_t                  n_vehicle;  ///< the first are the vehicle's, the others the server's own
} ivl_crtp_params_t;

/// What the server's own parameters and logs show.
typedef struct
{
    ivl_crtp_time_t      time;
    ivl_crtp_fault_cfg_t fault;
    uint32_t             freeze_ms, cut_ms;             ///< written: begin; 0 when they are over
    uint32_t             n_rx, n_tx, n_bad, n_foreign;  ///< packets: from the client, to it, malformed or refused, from others
    uint32_t             n_lost, n_duplicated, n_reordered;
} ivl_crtp_own_t;

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
    uint8_t           group_mask;  ///< of the high-level commander
    uint8_t           address;     ///< last byte of the radio address: who is meant by packed poses
    const uint8_t    *phase, *ended;
    uint8_t           last_phase, last_ended;
    bool              is_held;  ///< the answer to run_to_ms waits until it is reached
    ivl_crtp_packet_t held;
};

/// @param[out] error  one line, if the result is false
bool ivl_crtp_open(ivl_crtp_t *crtp, ivl_cf_t *cf, const ivl_crtp_host_t *host, char *error, size_t error_size);
void ivl_crtp_close(ivl_crtp_t *crtp);

/// A datagram of the client.
void ivl_crtp_receive(ivl_crtp_t *crtp, const uint8_t *bytes, size_t size);

/// One millisecond of the vehicle, and all packets that follow from it.
void ivl_crtp_step(ivl_crtp_t *crtp);

/// The client has come or gone; gone, its log blocks are deleted, as over radio.
void ivl_crtp_link(ivl_crtp_t *crtp, bool up);

uint64_t ivl_crtp_time_ms(const ivl_crtp_t *crtp);

// ---- one file each

void ivl_crtp_send(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet);
void ivl_crtp_bad(ivl_crtp_t *crtp);

bool ivl_crtp_params_open(ivl_crtp_t *crtp, char *error, size_t error_size);
void ivl_crtp_params_close(ivl_crtp_t *crtp);
/// The present values are the defaults; for the program around it, which may set some of the server's own after the opening.
void ivl_crtp_params_take_defaults(ivl_crtp_t *crtp);
void ivl_crtp_params_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet);
void ivl_crtp_params_step(ivl_crtp_t *crtp);
void ivl_crtp_params_misc(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet);
/// Copies a value into a parameter and tells who must know.  @return true if the answer has to wait
bool ivl_crtp_params_write(ivl_crtp_t *crtp, uint16_t id, const uint8_t *value);
/// Keeps the answer until the vehicle is where it has to run to.
void ivl_crtp_params_hold(ivl_crtp_t *crtp, const ivl_crtp_packet_t *reply);
/// Bytes of a value; 0 for an unknown type.
size_t ivl_crtp_param_size(uint8_t type);

bool ivl_crtp_logs_open(ivl_crtp_t *crtp, char *error, size_t error_size);
void ivl_crtp_logs_close(ivl_crtp_t *crtp);
void ivl_crtp_logs_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet);
void ivl_crtp_logs_step(ivl_crtp_t *crtp);
void ivl_crtp_logs_reset(ivl_crtp_t *crtp);
/// Value of a log variable as it is sent.  @return bytes
size_t ivl_crtp_log_value(const ivl_cf_log_t *row, uint8_t fetch, uint8_t *bytes);
/// Bytes of a type, half precision included; 0 for an unknown one.
size_t ivl_crtp_log_size(uint8_t type);

void ivl_crtp_memory_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet);
void ivl_crtp_link_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet);
void ivl_crtp_platform_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet);
void ivl_crtp_supervisor_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet);
void ivl_crtp_rpyt_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet);
void ivl_crtp_generic_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet);
void ivl_crtp_high_level_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet);
void ivl_crtp_localization_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet);

/// The server's own rows.  @return how many; rows may be NULL
size_t ivl_crtp_own_params(ivl_crtp_own_t *own, ivl_cf_param_t *rows);
size_t ivl_crtp_own_logs(ivl_crtp_own_t *own, ivl_cf_log_t *rows);
/// A parameter of its own was written: makes the value allowed.
void ivl_crtp_own_clamp(ivl_crtp_own_t *own);
#endif  // IVL_CRTP_SERVER_H
