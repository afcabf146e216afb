/// @file sim_core.h
/// Where the flight core of a world runs: linked into the simulator, or anywhere else that gives the same bits.
#ifndef IVL_SIM_CORE_H
#define IVL_SIM_CORE_H

#include "ivl.h"

/// A place where cores run.  Each thread that flies landings opens one port; a port holds one core per lane.
/// The `state` of a call is owned by the world; after the call it equals the state of the core, wherever that lives.
typedef struct
{
    void *context;  ///< argument of open
    void *(*open)(void *context);
    void (*close)(void *port);
    void (*init)(void *port, int lane, const ivl_cfg_t *cfg, ivl_state_t *state);
    ivl_status_t (*commit)(void *port, int lane, const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_policy_t *policy);
    void (*step)(void *port, int lane, const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_in_t *in, ivl_out_t *out);
    /// A step up to the tracking controller, see ivl_step_decide: the world computes the thrusts of all lanes at once, and has no use for the
    /// rest.  NULL: this core does whole steps only.
    bool (*decide)(void *port, int lane, const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_in_t *in, ivl_out_t *out,
                   ivl_reference_t *ref);
    bool every_tick;  ///< false: ticks are left out while the core's motors are latched off, when they decide nothing
    /// True: there is an autopilot around the core, which gets what the sensors say and drives the motors.  False: the world takes its place
    /// (sim_autopilot.h).
    bool has_autopilot;
} ivl_sim_core_t;

/// The core that is linked with the simulator; its port is NULL.
extern const ivl_sim_core_t ivl_sim_core_linked;

#endif  // IVL_SIM_CORE_H
