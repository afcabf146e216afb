/// @file ivl_handover.h
/// Change of the controller without a step: the difference of the two thrusts is added to the new one and fades away.
/// For the port; the pipeline does not use it.
#ifndef IVL_HANDOVER_H
#define IVL_HANDOVER_H

/// Thrusts are per motor, as a share of the largest (0..1).
typedef struct
{
    float offset_norm;  ///< to be added in this tick
    float step_norm;    ///< what a tick takes off
} ivl_handover_t;

/// Start a hand-over.  Nothing fades when either side has its motors off (0 or less), or a value is no number: a stop is a stop.
/// @param[in] from_norm   last thrust of the old controller
/// @param[in] to_norm     first thrust of the new one
/// @param[in] handover_s  duration; 0: none
/// @param[in] dt_s        time between two calls of ivl_handover_next
void ivl_handover_begin(ivl_handover_t *handover, float from_norm, float to_norm, float handover_s, float dt_s);

/// Offset of this tick; then let it fade by one tick.
float ivl_handover_next(ivl_handover_t *handover);
#endif  // IVL_HANDOVER_H
