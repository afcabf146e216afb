/// @file crtp_own.h
/// The server's own parameters and log variables: time and link faults.
#ifndef IVL_CRTP_OWN_H
#define IVL_CRTP_OWN_H
#include "cf/cf.h"
#include "crtp_faults.h"
#include "crtp_time.h"

/// What the server's own parameters and logs show.
typedef struct
{
    ivl_crtp_time_t      time;
    ivl_crtp_fault_cfg_t fault;
    ivl_crtp_fault_cfg_t fault_kept;                    ///< of the command line and the control channel: what a client leaves behind
    uint32_t             freeze_ms, cut_ms;             ///< written: begin; 0 when they are over
    uint32_t             n_rx, n_tx, n_bad, n_foreign;  ///< packets: from the client, to it, malformed or refused, from others
    uint32_t             n_lost, n_duplicated, n_reordered;
} ivl_crtp_own_t;

/// Its rows.  @return how many; rows may be NULL
size_t ivl_crtp_own_params(ivl_crtp_own_t *own, ivl_cf_param_t *rows);
size_t ivl_crtp_own_logs(ivl_crtp_own_t *own, ivl_cf_log_t *rows);

/// One of its parameters was written: makes the value allowed.
void ivl_crtp_own_clamp(ivl_crtp_own_t *own);

/// Faults were set by who started the vehicle, and not by a client: those that differ from `before` stay when a client goes.
void ivl_crtp_own_keep(ivl_crtp_own_t *own, const ivl_crtp_fault_cfg_t *before);
#endif  // IVL_CRTP_OWN_H
