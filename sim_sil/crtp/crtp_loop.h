/// @file crtp_loop.h
/// One vehicle on one UDP port: socket, client, faults of the link, and time, in one thread that waits in one place.
#ifndef IVL_CRTP_LOOP_H
#define IVL_CRTP_LOOP_H
#include <signal.h>

#include "crtp_dispatch.h"
#include "crtp_session.h"

typedef struct
{
    int                  fd, control_fd;  ///< the latter -1: no control channel
    uint8_t              address;         ///< last byte of the radio address
    float                speed_factor;    ///< 0: as fast as possible
    bool                 lockstep;
    uint32_t             packets_per_s;  ///< to the client, when time is not paced
    ivl_crtp_fault_cfg_t fault;
} ivl_crtp_loop_cfg_t;

typedef struct
{
    ivl_crtp_t         crtp;
    ivl_crtp_session_t session;
    ivl_crtp_faults_t  faults;
    int                fd, control_fd;
    uint64_t           now_us, frozen_until_us, refilled_us;
    uint64_t           probed_us, told_us;     ///< when the client was last sent nothing, and another one was last told who flies
    double             credit, packets_per_s;  ///< packets that may be sent now
    uint32_t           freeze_ms, cut_ms;      ///< that have begun
} ivl_crtp_loop_t;

/// @param[out] error  one line, if the result is false
bool ivl_crtp_loop_open(ivl_crtp_loop_t *loop, ivl_cf_t *cf, const ivl_crtp_loop_cfg_t *cfg, char *error, size_t error_size);
void ivl_crtp_loop_close(ivl_crtp_loop_t *loop);

/// Serves until *stop is set.
void ivl_crtp_loop_run(ivl_crtp_loop_t *loop, const volatile sig_atomic_t *stop);
#endif  // IVL_CRTP_LOOP_H
