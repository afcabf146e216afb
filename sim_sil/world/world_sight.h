/// @file world_sight.h
/// The clock of a camera that is rendered: when it looks, from where, and when the core is told what it saw.        [CAMERA section 7]
#ifndef IVL_WORLD_SIGHT_H
#define IVL_WORLD_SIGHT_H

#include "sim_rng.h"
#include "world_scene.h"

enum
{
    IVL_SIM_SIGHT_QUEUE = 16  ///< readings under way: more than the longest delay times the highest rate
};

typedef struct
{
    double  due_s;      ///< arrival
    double  sampled_s;  ///< instant of the cues, less what the sender does not know of: what the core takes for their arrival
    float   rrev_per_s, of_y_radps;
    uint8_t valid;
    uint8_t lost;
} ivl_sim_sighting_t;

typedef struct
{
    double             next_s;  ///< middle of the next exposure
    uint32_t           n_taken, n_delivered;
    ivl_sim_sighting_t queue[IVL_SIM_SIGHT_QUEUE];
} ivl_sim_sight_t;

/// A camera with a clock of its own that has seen nothing yet.
/// @param[in] port  of the model's eye; NULL: nobody looks
void ivl_sim_sight_start(const ivl_sim_model_t *model, void *port, int lane, const ivl_sim_rng_t *rng, ivl_sim_sight_t *sight);

/// Takes the pictures that fell due (exact for constant acceleration and rate), and hands over the readings that have arrived.
/// @param[in] looks   false: no more pictures are taken
/// @param[in,out] in  its time, attitude and rates are known already
void ivl_sim_sight_read(const ivl_sim_scene_t *scene, void *port, int lane, const ivl_sim_rng_t *rng, double t_s, bool looks,
                        ivl_sim_sight_t *sight, ivl_in_t *in);

#endif  // IVL_WORLD_SIGHT_H
