/// @file sil.h
/// Flat C interface of the simulator for other languages.
///
/// The layout of every struct that crosses it is told by tables which the library exports, so that no caller repeats a
/// field.  All functions may be called from several threads at once; a model is constant after its creation.
#ifndef IVL_SIL_H
#define IVL_SIL_H

#include <stddef.h>
#include <stdint.h>

/// One field of a table.
typedef struct
{
    const char *name;    ///< parameters are dotted: "group.name"
    const char *type;    ///< numpy type code: "f8", "i4", "u4", "u8", "i1"
    uint32_t    offset;  ///< bytes from the start of the item
    uint32_t    count;   ///< elements; 1 is a scalar
    const char *unit;    ///< "1" if dimensionless
    double      lo, hi;  ///< allowed or possible range
    double      dflt;    ///< NaN: must be given
    const char *doc;
} ivl_sil_field_t;

typedef enum
{
    IVL_SIL_TABLE_PARAM,       ///< input of ivl_sil_model_create: doubles
    IVL_SIL_TABLE_SPEC,        ///< input of a rollout
    IVL_SIL_TABLE_OUTCOME,     ///< result of a rollout
    IVL_SIL_TABLE_TRACE,       ///< one row of a time series
    IVL_SIL_TABLE_DERIVED,     ///< what follows from the parameters
    IVL_SIL_TABLE_REPLAY_IN,   ///< what the flight core is told in one tick of a replay
    IVL_SIL_TABLE_REPLAY_OUT,  ///< what it answers
    IVL_SIL_TABLE_SURFACE,     ///< the plane that is landed on
    IVL_SIL_TABLE_COUNT
} ivl_sil_table_t;

enum
{
    IVL_SIL_ABI_VERSION = 3
};

int ivl_sil_abi_version(void);

/// Chooses the registers in which rollouts stand side by side; their bits do not depend on it.  Holds for every thread of the process.
/// @param[in] bits  128, 256 or 512; 0: the widest that the machine has, as at the start; -1: no change
/// @return their width, 0 with nothing changed if the machine has none of the width that was asked for
int ivl_sil_register_bits(int bits);

/// Fields of a table, NULL if there is no such table.
const ivl_sil_field_t *ivl_sil_table(int table, uint32_t *n_fields, uint32_t *item_size);

/// @param[in] params  in the order of IVL_SIL_TABLE_PARAM
/// @param[out] error  one line, if the result is NULL
void *ivl_sil_model_create(const double *params, char *error, size_t error_size);
void  ivl_sil_model_free(void *model);
void  ivl_sil_model_derived(const void *model, void *derived);
void  ivl_sil_model_surface(const void *model, void *surface);

/// Unit vector along a surface (IVL_SIL_TABLE_SURFACE) that is forward: the world's x axis, turned the shortest way from z up to the normal.
void ivl_sil_surface_forward(const void *surface, double forward_W[3]);

/// Flies n landings on n_threads threads (0: as many as the machine has cores).  Each outcome depends on its spec alone.
/// @param[out] work  evaluations of the forces that the lanes could have made, and those that the landings asked for; may be NULL
/// @return 0
int ivl_sil_rollouts(const void *model, const void *specs, size_t n, int n_threads, void *outcomes, uint64_t work[2]);

/// One landing with its time series; rows beyond the capacity are counted, not written.
/// @return rows that the landing has; -1 if the period is not positive
long ivl_sil_trace(const void *model, const void *spec, double period_s, void *rows, size_t capacity, void *outcome);

/// Flies n landings as ivl_sil_rollouts, each with its time series: `capacity` rows a landing in `rows`.
/// @param[out] n_rows  rows that each landing has; those beyond the capacity are counted, not written
/// @return 0; -1 if the period is not positive, or there is no memory
int ivl_sil_traces(const void *model, const void *specs, size_t n, int n_threads, double period_s, void *rows, size_t capacity,
                   uint64_t *n_rows, void *outcomes);

/// A flight core of this configuration (layout IVL_SIL_LAYOUT_CONFIG) and policy (form, and 64 parameters in SI) steps through n recorded inputs, where the model's core runs.
/// @param[out] rows  n rows of IVL_SIL_TABLE_REPLAY_OUT
/// @return 0; 1 if the core refuses the configuration, 2 if it refuses the policy
int ivl_sil_replay(const void *model, const void *config, int form, const double *theta, const void *inputs, size_t n, void *rows);

/// Flies n hovers, each through n_setpoints set-points of four numbers: time from which it holds (s), position (m).  A flight starts at its
/// first set-point and has n_rows rows of IVL_SIL_TABLE_TRACE, one each period.
/// @param[in] seeds  seed and stream of each flight
/// @return 0; -1 if the period is not positive, or there are no rows or no set-points
int ivl_sil_hover(const void *model, const double *setpoints, size_t n_setpoints, const uint64_t *seeds, size_t n, double period_s,
                  void *rows, size_t n_rows);

/// A form of policies (ivl_form.h).
/// @return number of its parameters; 0 if there is no form with that number
uint32_t ivl_sil_form(int number, const char **name, const char **doc);

/// A group of parameters of a form, in the order of its array of floats: names and symbols of `count` parameters with spaces between, range
/// in SI; `dflt` is what one `unit` is in SI.
/// @return 0; -1 if there is none
int ivl_sil_form_group(int number, uint32_t g, ivl_sil_field_t *field, const char **symbols);

/// 1 if a flight core with this model's configuration puts the policy in force, else 0.
int ivl_sil_policy_accepted(const void *model, int form, const double *theta);

/// What a policy decides of n things that are seen, three numbers each: distance to the ceiling (m), RREV (1/s), OF_y (rad/s).
/// @param[out] actions  four numbers each: 1 to flip, 1 to go, moment of the flip (N m), probability of a landing
void ivl_sil_policy_decide(int form, const double *theta, const double *seen, size_t n, double *actions);

/// CRC-32 of a policy, as the vehicle computes it; 0 if there is no such form.
uint32_t ivl_sil_policy_crc(int form, const double *theta);

const char *ivl_sil_end_reason(int code);
const char *ivl_sil_phase_name(int code);

#endif  // IVL_SIL_H
