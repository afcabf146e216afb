#include "crtp_time.h"

void ivl_crtp_time_restart(ivl_crtp_time_t *time)
{
    time->anchored = false;
    time->running = false;
}

bool ivl_crtp_time_ask(ivl_crtp_time_t *time, uint64_t vehicle_us)
{
    if (time->run_to_ms != time->asked_ms)
    {
        time->asked_ms = time->run_to_ms;
        time->running = (uint64_t)time->run_to_ms * 1000u > vehicle_us;
    }
    return time->lockstep != 0u && time->running;
}

void ivl_crtp_time_stop(ivl_crtp_time_t *time, uint64_t vehicle_us)
{
    time->running = false;
    time->run_to_ms = (uint32_t)(vehicle_us / 1000u);
}

static bool is_paced(const ivl_crtp_time_t *time)
{
    return time->speed_factor > 0.0f;
}

// from the anchor on, so that no rounding accumulates
static uint64_t paced_us(const ivl_crtp_time_t *time, uint64_t wall_us)
{
    return time->vehicle_us + (uint64_t)((double)(wall_us - time->wall_us) * (double)time->speed_factor);
}

uint64_t ivl_crtp_time_target_us(ivl_crtp_time_t *time, uint64_t wall_us, uint64_t vehicle_us)
{
    if (time->lockstep != 0u)
    {
        return time->running ? (uint64_t)time->run_to_ms * 1000u : vehicle_us;
    }
    if (!is_paced(time))
    {
        return UINT64_MAX;
    }
    const uint64_t behind_us_max = (uint64_t)(IVL_CRTP_BEHIND_US_MAX * (double)time->speed_factor);
    const bool     slipped = time->anchored && (paced_us(time, wall_us) > vehicle_us + behind_us_max);
    if (slipped || !time->anchored)
    {
        time->n_slipped += slipped ? 1u : 0u;
        time->skipped_us += slipped ? paced_us(time, wall_us) - vehicle_us : 0u;
        time->anchored = true;
        time->wall_us = wall_us;
        time->vehicle_us = vehicle_us;
    }
    return paced_us(time, wall_us);
}

uint64_t ivl_crtp_time_wake_us(const ivl_crtp_time_t *time, uint64_t vehicle_us)
{
    if (time->lockstep != 0u)
    {
        return time->running ? 0u : UINT64_MAX;
    }
    if (!is_paced(time) || !time->anchored)
    {
        return 0u;
    }
    const uint64_t ahead_us = vehicle_us + 1000u - time->vehicle_us;
    return time->wall_us + (uint64_t)((double)ahead_us / (double)time->speed_factor) + 1u;
}
