/// @file ivl_handover.c
#include "ivl_handover.h"

#include "ivl_math.h"

void ivl_handover_begin(ivl_handover_t *handover, float from_norm, float to_norm, float handover_s, float dt_s)
{
    *handover = (ivl_handover_t){0.0f, 0.0f};
    if ((from_norm > 0.0f) && (from_norm <= 1.0f) && (to_norm > 0.0f) && (to_norm <= 1.0f) && (handover_s > dt_s))
    {
        handover->offset_norm = from_norm - to_norm;
        handover->step_norm = fabsf(handover->offset_norm) * dt_s / handover_s;
    }
}

float ivl_handover_next(ivl_handover_t *handover)
{
    const float offset = handover->offset_norm;
    const float left = fabsf(offset) - handover->step_norm;
    const float faded = (left > 0.0f) ? left : 0.0f;
    handover->offset_norm = (offset < 0.0f) ? -faded : faded;
    return offset;
}
