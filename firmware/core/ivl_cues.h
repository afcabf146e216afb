/// @file ivl_cues.h
/// Stage 3: sensory cues of a flat surface, RREV and ventral flow [P eq. 1, 2].  Pure, O(1).
#ifndef IVL_CUES_H
#define IVL_CUES_H
#include "ivl_ceiling.h"

typedef struct
{
    float rrev_per_s;  ///< v_close / d, > 0 while closing; 0 if invalid
    float of_y_radps;  ///< flow of the surface, -v_along / d: of a ceiling about body y of a level body; 0 if invalid
    bool  valid;       ///< false: the fields above must not be used
} ivl_cues_t;

/// What is seen of the ceiling in a tick.
typedef struct
{
    ivl_ceiling_t ceiling;
    ivl_cues_t    cues;
} ivl_seen_t;

/// Cues from the surface and the speed forward along it.
/// @return .valid is false if the ceiling is invalid or its distance not positive
ivl_cues_t ivl_cues_compute(ivl_ceiling_t ceiling, float along_mps);

/// Put the flow sensor's reading in the place of OF_y, if cfg->of_source asks for it and the reading is valid and not older than d_old_s_max.
void ivl_cues_take_flow(const ivl_cfg_t *cfg, const ivl_in_t *in, ivl_cues_t *cues);
#endif  // IVL_CUES_H
