/// @file crtp_own.c
/// The server's own parameters and log variables: time and link faults.  Beside those of the vehicle in the same tables.
#include "crtp_own.h"

#include <string.h>

static const float SPEED_MIN = 0.001f;  // but for 0, which is no pace at all
static const float SPEED_MAX = 1000.0f;

// so long nobody reaches the vehicle at most, whoever asks for it
static const uint32_t AWAY_MS_MAX = 60000u;

static float clamped(float value, float lo, float hi, float otherwise)
{
    if (!(value >= lo) && !(value <= lo))
    {
        return otherwise;
    }
    return (value < lo) ? lo : ((value > hi) ? hi : value);
}

#define PARAM_TYPE_float    IVL_CF_PARAM_F32
#define PARAM_TYPE_uint32_t IVL_CF_PARAM_U32
#define FAULT_ROW(ctype, member, unit, lo, hi, doc)                                                                                        \
    {.group = "fault", .name = #member, .type = PARAM_TYPE_##ctype, .address = &own->fault.member},

size_t ivl_crtp_own_params(ivl_crtp_own_t *own, ivl_cf_param_t *rows)
{
    const ivl_cf_param_t own_rows[] = {
        {.group = "sil", .name = "lockstep", .type = IVL_CF_PARAM_U8, .address = &own->time.lockstep},
        {.group = "sil", .name = "speed_factor", .type = IVL_CF_PARAM_F32, .address = &own->time.speed_factor},
        {.group = "sil", .name = "run_to_ms", .type = IVL_CF_PARAM_U32, .address = &own->time.run_to_ms},
        {.group = "sil", .name = "run_until", .type = IVL_CF_PARAM_U16, .address = &own->time.run_until},
        IVL_CRTP_FAULTS(FAULT_ROW) /* */
        {.group = "fault", .name = "freeze_ms", .type = IVL_CF_PARAM_U32, .address = &own->freeze_ms},
        {.group = "fault", .name = "cut_ms", .type = IVL_CF_PARAM_U32, .address = &own->cut_ms},
    };
    if (rows != NULL)
    {
        memcpy(rows, own_rows, sizeof own_rows);
    }
    return sizeof own_rows / sizeof own_rows[0];
}

size_t ivl_crtp_own_logs(ivl_crtp_own_t *own, ivl_cf_log_t *rows)
{
    const ivl_cf_log_t own_rows[] = {
        {.group = "sil", .name = "n_rx", .type = IVL_CF_LOG_U32, .address = &own->n_rx},
        {.group = "sil", .name = "n_tx", .type = IVL_CF_LOG_U32, .address = &own->n_tx},
        {.group = "sil", .name = "n_bad", .type = IVL_CF_LOG_U32, .address = &own->n_bad},
        {.group = "sil", .name = "n_foreign", .type = IVL_CF_LOG_U32, .address = &own->n_foreign},
        {.group = "sil", .name = "n_slipped", .type = IVL_CF_LOG_U32, .address = &own->time.n_slipped},
        {.group = "fault", .name = "n_lost", .type = IVL_CF_LOG_U32, .address = &own->n_lost},
        {.group = "fault", .name = "n_duplicated", .type = IVL_CF_LOG_U32, .address = &own->n_duplicated},
        {.group = "fault", .name = "n_reordered", .type = IVL_CF_LOG_U32, .address = &own->n_reordered},
    };
    if (rows != NULL)
    {
        memcpy(rows, own_rows, sizeof own_rows);
    }
    return sizeof own_rows / sizeof own_rows[0];
}

// what is out of range becomes the nearest allowed value, what is no number becomes harmless
#define CLAMP_float(member, lo, hi)                 own->fault.member = clamped(own->fault.member, lo, hi, 0.0f);
#define CLAMP_uint32_t(member, lo, hi)              /* any number is a seed */
#define CLAMP_ROW(ctype, member, unit, lo, hi, doc) CLAMP_##ctype(member, lo, hi)

void ivl_crtp_own_clamp(ivl_crtp_own_t *own)
{
    IVL_CRTP_FAULTS(CLAMP_ROW)
    const float speed = clamped(own->time.speed_factor, 0.0f, SPEED_MAX, 1.0f);
    own->time.speed_factor = ((speed > 0.0f) && (speed < SPEED_MIN)) ? SPEED_MIN : speed;
    own->freeze_ms = (own->freeze_ms < AWAY_MS_MAX) ? own->freeze_ms : AWAY_MS_MAX;
    own->cut_ms = (own->cut_ms < AWAY_MS_MAX) ? own->cut_ms : AWAY_MS_MAX;
}

#define KEEP_ROW(ctype, member, unit, lo, hi, doc)                                                                                         \
    if (memcmp(&own->fault.member, &before->member, sizeof before->member) != 0)                                                           \
    {                                                                                                                                      \
        own->fault_kept.member = own->fault.member;                                                                                        \
    }

void ivl_crtp_own_keep(ivl_crtp_own_t *own, const ivl_crtp_fault_cfg_t *before)
{
    IVL_CRTP_FAULTS(KEEP_ROW)
}
