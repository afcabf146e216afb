#include "sim_core.h"

static void *open_port(void *context)
{
    (void)context;
    return NULL;
}

static void close_port(void *port)
{
    (void)port;
}

static void init(void *port, int lane, const ivl_cfg_t *cfg, ivl_state_t *state)
{
    (void)port, (void)lane;
    ivl_init(cfg, state);
}

static ivl_status_t commit(void *port, int lane, const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_policy_t *policy)
{
    (void)port, (void)lane;
    return ivl_policy_commit(cfg, state, policy);
}

static void step(void *port, int lane, const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_in_t *in, ivl_out_t *out)
{
    (void)port, (void)lane;
    ivl_step(cfg, state, in, out);
}

static bool decide(void *port, int lane, const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_in_t *in, ivl_out_t *out, ivl_reference_t *ref)
{
    (void)port, (void)lane;
    return ivl_step_decide(cfg, state, in, out, ref);
}

const ivl_sim_core_t ivl_sim_core_linked = {
    .open = open_port, .close = close_port, .init = init, .commit = commit, .step = step, .decide = decide};
