/// @file ivl_attitude.c
/// q' = q * (w dt / 2, 1) / |...|: the small turn is applied on the right, since w is given in B.
#include "ivl_attitude.h"

#include <string.h>

#include "ivl_math.h"

static ivl_quat_t turned(ivl_quat_t q, ivl_vec3_t half)
{
    const ivl_quat_t t = {
        q.x + q.w * half.x + q.y * half.z - q.z * half.y,
        q.y + q.w * half.y + q.z * half.x - q.x * half.z,
        q.z + q.w * half.z + q.x * half.y - q.y * half.x,
        q.w - q.x * half.x - q.y * half.y - q.z * half.z,
    };
    const float scale = 1.0f / sqrtf(t.x * t.x + t.y * t.y + t.z * t.z + t.w * t.w);
    return (ivl_quat_t){t.x * scale, t.y * scale, t.z * scale, t.w * scale};
}

void ivl_attitude_update(ivl_attitude_t *attitude, ivl_quat_t q_estimate_WB, bool is_followed, ivl_vec3_t w_B_radps, float dt_s)
{
    // bytes, not numbers: an estimate that is no number also counts as seen
    const bool is_new = memcmp(&attitude->q_seen, &q_estimate_WB, sizeof q_estimate_WB) != 0;
    attitude->q_seen = q_estimate_WB;
    attitude->q_WB = (is_followed && is_new) ? q_estimate_WB : turned(attitude->q_WB, ivl_scale(w_B_radps, 0.5f * dt_s));
}
