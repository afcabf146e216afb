/// @file cf_estimate.h
/// Position from outside: what the host sends over the localization port, as a position estimate with a velocity.
#ifndef IVL_CF_ESTIMATE_H
#define IVL_CF_ESTIMATE_H
#include "ivl_attitude.h"
#include "ivl_sense.h"

typedef struct
{
    bool           has_position, has_attitude;
    uint64_t       t_us;  ///< arrival of the last packet
    uint32_t       n;     ///< packets
    ivl_vec3_t     p_W_m;
    ivl_vec3_t     v_W_mps;   ///< differences of positions through a first-order filter
    ivl_quat_t     q_WB;      ///< of the last pose
    ivl_attitude_t attitude;  ///< carried on with the gyro in between
} ivl_cf_estimate_t;

/// Axes of an estimate that did not begin where the vehicle was, as one without position from outside.
typedef struct
{
    bool       is_other;  ///< than the world's
    ivl_vec3_t from_W_m;  ///< the vehicle when it began
    ivl_vec3_t to_m;      ///< and what it was told
    float      turn_rad;
} ivl_cf_frame_t;

/// A sample of the world as that estimate has it.
void ivl_cf_frame_apply(const ivl_cf_frame_t *frame, ivl_in_t *in);

void ivl_cf_estimate_reset(ivl_cf_estimate_t *e);

/// A packet has arrived.
/// @param[in] q_WB  NULL: position only
void ivl_cf_estimate_packet(ivl_cf_estimate_t *e, uint64_t now_us, ivl_vec3_t p_W_m, const ivl_quat_t *q_WB);

/// Replaces position, velocity, their age, and with poses the attitude, by what has arrived; before the first packet the sample stays and grows
/// as old as the vehicle.  Once a tick.
void ivl_cf_estimate_fill(ivl_cf_estimate_t *e, float dt_s, ivl_in_t *in);

#endif  // IVL_CF_ESTIMATE_H
