/// @file ivl_cues.c
#include "ivl_cues.h"

ivl_cues_t ivl_cues_compute(ivl_ceiling_t ceiling, ivl_vec3_t v_WB_mps)
{
    if (ceiling.valid && (ceiling.d_ceil_m > 0.0f))
    {
        return (ivl_cues_t){
            .rrev_per_s = ceiling.v_close_mps / ceiling.d_ceil_m,
            .of_y_radps = -v_WB_mps.x / ceiling.d_ceil_m,
            .valid = true,
        };
    }
    return (ivl_cues_t){0};
}
