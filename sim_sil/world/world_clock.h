/// @file world_clock.h
/// The clock of the flight core, as the world's time.
#ifndef IVL_WORLD_CLOCK_H
#define IVL_WORLD_CLOCK_H

#include <stdint.h>

/// What is due at a tick happens at that tick and not at the next one because of rounding.
#define IVL_SIM_TIME_SLACK_S 1.0e-9

/// The core's clock shows 1 s at the start of a rollout: samples older than the start stay positive.
static inline uint64_t ivl_sim_clock_us(double t_s)
{
    return (uint64_t)((t_s + 1.0) * 1.0e6 + 0.5);
}

#endif  // IVL_WORLD_CLOCK_H
