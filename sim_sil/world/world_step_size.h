/// @file world_step_size.h
/// How long an integration step may be for the vehicle at hand, and how much work a motion may take.
///
/// Leapfrog is stable as long as the fastest motion, damped at the rate g and swinging at the frequency w, keeps
/// g dt + (w dt)^2 / 4 below 1.                                                               [MODEL eq. 7.6 - 7.9]
#ifndef IVL_WORLD_STEP_SIZE_H
#define IVL_WORLD_STEP_SIZE_H

#include "sim_model.h"

enum
{
    /// A contact that is not located after so many tries is taken where it is: the try before was within a few tolerances.
    IVL_SIM_LOCATE_MAX = 12,
    /// A step that is still too long for the forces which it meets is taken as it is after so many.
    IVL_SIM_RETRIES_MAX = 14,
    /// Evaluations of the forces for one step, at most: one after an event, the first try, the others.
    IVL_SIM_STEP_EVALUATIONS = IVL_SIM_RETRIES_MAX + 2,
    IVL_SIM_TURNS_MAX = 16,  ///< what the limit on a step's turn can shorten it by
};

/// Evaluations of the forces that a landing may take, and a tick by the way: a landing takes a few hundred to twenty thousand, and
/// some ten million at a thousandth of the default steps.                                              [MODEL sec. 6]
#define IVL_SIM_EVALUATIONS_MAX 100000000u

/// What a chosen step has of the limit of stability, which is 1.
#define IVL_SIM_STABLE 0.9

/// Relative error of a rod's length that its turning in a chosen step would lead to, if it lasted.   [MODEL eq. 7.10]
#define IVL_SIM_DRIFT 1.7

/// Relative error of a rod's length from which on steps become shorter, so that it shrinks.
#define IVL_SIM_STRETCH 0.1

/// A tried step may be longer than a chosen one by this factor, about; else it is tried again, shorter.
#define IVL_SIM_TRIED_MORE 1.1

/// Derives model->step from the rest of the model.
/// @param[out] error  one line, if the result is false: the legs are too stiff for any step
bool ivl_sim_step_derive(ivl_sim_model_t *model, char *error, size_t error_size);

/// Motion of the legs, as an evaluation found it: see ivl_sim_rate_t.
typedef struct
{
    ivl_wide_t swing_norm, turn2_per_s2, stretch_norm;
} ivl_sim_pace_t;

/// True unless a step of dt is longer than the motion of the legs allows, by a factor of `more` at least.  Motion that is no
/// number does not shorten a step.
IVL_SIM_INLINE ivl_mask_t ivl_sim_step_allowed(const ivl_sim_step_limits_t *step, const ivl_sim_pace_t *pace, double more, ivl_wide_t dt_s)
{
    const ivl_wide_t g = pace->swing_norm * step->swing_damping_per_s + step->damping_per_s;
    const ivl_wide_t quarter = pace->swing_norm * step->swing_quarter_per_s2, turn2 = pace->turn2_per_s2;
    const ivl_wide_t stretch2 = pace->stretch_norm * pace->stretch_norm * (1.0 / (IVL_SIM_STRETCH * IVL_SIM_STRETCH));
    const ivl_mask_t rings = dt_s * (g + dt_s * quarter) > more * IVL_SIM_STABLE;
    const ivl_mask_t drifts = dt_s * dt_s * turn2 * (turn2 + 4.0 * quarter) > more * more * step->drift_per_s2;
    return ~(rings | drifts | (dt_s * stretch2 * stretch2 > more * step->longest_s));
}

/// Longest step, up to `most_s`, that may be chosen.
ivl_wide_t ivl_sim_step_longest(const ivl_sim_step_limits_t *step, const ivl_sim_pace_t *pace, ivl_wide_t most_s);

/// Evaluations of the forces that a motion may take before it is given up.  Never 0.
uint32_t ivl_sim_step_evaluations(const ivl_sim_step_limits_t *step, double span_s);

#endif  // IVL_WORLD_STEP_SIZE_H
