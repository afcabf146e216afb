/// @file app_reading.c
/// Readings of a camera: checked in the task of their sender, kept by the stabilizer's task.
#include "app_convert.h"
#include "app_ivl.h"

// no sensor sends longer after its sampling instant; the core remembers that and the longest ivl.rrev_delay
static const float AGE_S_MAX = 0.06f;

// the core's own limit of a flow
static const float FLOW_RADPS_MAX = 100.0f;

static const float US_PER_S = 1.0e6f;

// in positive form: what is no number is not good; a value that its sender calls invalid is not looked at
static bool is_good(const ivl_cfg_t *cfg, const ivl_wire_reading_t *packet)
{
    const uint8_t known = (uint8_t)IVL_WIRE_VALID_RREV | (uint8_t)IVL_WIRE_VALID_FLOW;
    const bool    has_rrev = (packet->valid & (uint8_t)IVL_WIRE_VALID_RREV) != 0u;
    const bool    has_flow = (packet->valid & (uint8_t)IVL_WIRE_VALID_FLOW) != 0u;
    return (packet->valid <= known) && (packet->age_s >= 0.0f) && (packet->age_s <= AGE_S_MAX) &&
           (!has_rrev || ivl_within(packet->rrev_per_s, cfg->rrev_per_s_max)) &&
           (!has_flow || ivl_within(packet->of_y_radps, FLOW_RADPS_MAX));
}

static ivl_reading_t reading(uint64_t t_us, float value, uint8_t valid)
{
    return (ivl_reading_t){.t_us = t_us, .value = (valid != 0u) ? value : 0.0f, .valid = (valid != 0u) ? 1u : 0u};
}

void app_reading_put(app_t *app, app_camera_t camera, const ivl_wire_reading_t *packet, uint64_t now_us)
{
    if (is_good(&app->cfg, packet))
    {
        const uint64_t   t_us = now_us - (uint64_t)(uint32_t)(packet->age_s * US_PER_S);
        const app_seen_t seen = {
            .rrev = reading(t_us, packet->rrev_per_s, packet->valid & (uint8_t)IVL_WIRE_VALID_RREV),
            .flow = reading(t_us, packet->of_y_radps, packet->valid & (uint8_t)IVL_WIRE_VALID_FLOW),
        };
        if (app_put(&app->seen_in[camera], seen))
        {
            atomic_fetch_add(&app->n_reading, 1u);
            return;
        }
    }
    atomic_fetch_add(&app->n_reading_bad, 1u);
}

// unless it was sampled before what is kept
static void keep(ivl_reading_t *kept, const ivl_reading_t *told)
{
    if (told->t_us > kept->t_us)
    {
        *kept = *told;
    }
}

void app_reading_take(app_t *app)
{
    for (int camera = 0; camera < APP_CAMERAS; camera++)
    {
        app_seen_t seen;
        if (app_take(&app->seen_in[camera], &seen))
        {
            keep(&app->seen.rrev, &seen.rrev);
            keep(&app->seen.flow, &seen.flow);
        }
    }
}

void app_reading_show(app_t *app)
{
    keep(&app->in.rrev, &app->seen.rrev);
    keep(&app->in.flow, &app->seen.flow);
}
