/// @file ivl_record.h
/// Flight recorder around one flip or level-out: a ring of compact rows, one a tick, that freezes a while after its begin and is then read as
/// a memory.  Its begin is the trigger, or the tick in which an approach was called off: the decision, the rise and the highest point stay.
/// For the port; the pipeline does not use it.  The reader sees a header of 36 bytes, then the rows in order of time, all little-endian.
#ifndef IVL_RECORD_H
#define IVL_RECORD_H
#include "ivl.h"
#include "ivl_wire.h"

#define IVL_RECORD_MAGIC     0x524C5649u  ///< "IVLR"
#define IVL_RECORD_VERSION   2u
#define IVL_RECORD_ROWS      448u     ///< 0.9 s at 500 Hz in 19.7 kB
#define IVL_RECORD_ROWS_POST 350u     ///< rows after the begin; the others are from before it
#define IVL_RECORD_NONE      0xFFFFu  ///< no row of a begin

// clang-format off
/// Header: X(type, name, doc)
#define IVL_RECORD_HEADER(X)                                                     \
    X(u32, magic, "IVL_RECORD_MAGIC")                                            \
    X(u8, version, "IVL_RECORD_VERSION")                                         \
    X(u8, row_size, "bytes a row")                                               \
    X(u16, n_rows, "rows that follow")                                           \
    X(u16, trigger_row, "row of the trigger, or of the begin of a level-out; IVL_RECORD_NONE if none") \
    X(u8, frozen, "1: complete; 0: still recording, no row can be read")         \
    X(u8, policy_form, "its form")                                               \
    X(u32, n_cycle, "recordings since the start")                                \
    X(u32, policy_seq, "number of the policy that triggered or was called off")  \
    X(u32, policy_crc, "its checksum")                                           \
    X(f32, tick_hz, "rows per second")                                           \
    X(f32, thrust_N_max, "thrust that 255 stands for, N")                        \
    X(u32, t_trigger_us, "low 32 bits of t_us at trigger_row")

/// Row: X(type, name, count, per_unit, unit, doc); value in `unit` = number / per_unit, limited to the range of the type
#define IVL_RECORD_ROW(X)                                                        \
    X(u32, t_us, 1, 1, "us", "low 32 bits of t_us")                         \
    X(i16, p, 3, 1000, "m", "position in W")                                     \
    X(i16, v, 3, 1000, "m/s", "velocity in W")                                   \
    X(i16, q, 4, 32767, "1", "quaternion q_WB: x, y, z, w")                      \
    X(i16, w, 3, 32, "rad/s", "angular velocity in B")                           \
    X(i16, f, 3, 100, "m/s^2", "specific force in B")                            \
    X(i16, d, 1, 1000, "m", "distance to the ceiling, 0 if invalid")             \
    X(u8, thrust, 4, 255, "thrust_N_max", "thrust commands M1..M4")              \
    X(u8, phase, 1, 1, "1", "ivl_phase_t")                                       \
    X(u8, rule, 1, 1, "1", "ivl_rule_t")
// clang-format on

#define IVL_RECORD_HEADER_MEMBER(type, name, doc)                     ivl_##type##_t name;
#define IVL_RECORD_ROW_MEMBER(type, name, count, per_unit, unit, doc) ivl_##type##_t name[count];

/// Both are laid out without padding on every machine that this runs on; the sizes are asserted in ivl_record.c.
typedef struct
{
    IVL_RECORD_HEADER(IVL_RECORD_HEADER_MEMBER)
} ivl_record_header_t;
typedef struct
{
    IVL_RECORD_ROW(IVL_RECORD_ROW_MEMBER)
} ivl_record_row_t;

typedef struct
{
    ivl_record_header_t header;
    uint16_t            next;    ///< row to be written
    uint16_t            n_post;  ///< rows since the trigger
    ivl_phase_t         last_phase;
    ivl_record_row_t    rows[IVL_RECORD_ROWS];
} ivl_recorder_t;

/// Nothing recorded.
void ivl_record_init(ivl_recorder_t *recorder);

/// After each ivl_step: starts anew with each arm cycle, and with an approach after one that was called off; records while not in IDLE, freezes
/// IVL_RECORD_ROWS_POST rows after the trigger or the begin of a level-out, or when the cycle ends earlier.
void ivl_record_step(ivl_recorder_t *recorder, const ivl_cfg_t *cfg, const ivl_state_t *state, const ivl_out_t *out);

/// Size of what can be read: header and IVL_RECORD_ROWS rows, whatever has been recorded.
uint32_t ivl_record_size(void);

/// Copy bytes as the reader sees them.  The header can be read always, rows only when frozen; those beyond n_rows are 0.
/// @return false, and *bytes unchanged, if rows are asked for while recording, or the range does not fit
bool ivl_record_read(const ivl_recorder_t *recorder, uint32_t address, uint32_t size, uint8_t *bytes);
#endif  // IVL_RECORD_H
