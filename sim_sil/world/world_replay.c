#include "world_replay.h"

#include <string.h>

enum
{
    LANE = 0  // of the port: one core is enough
};

static void note(const ivl_state_t *s, const ivl_out_t *o, ivl_sim_replay_row_t *row)
{
#define NOTE(c_type, name, np, unit, expression, doc) row->name = (expression);
    IVL_SIM_REPLAY_ROWS(NOTE)
#undef NOTE
}

static ivl_sim_replay_status_t start(const ivl_sim_core_t *core, void *port, const ivl_cfg_t *cfg, const ivl_policy_t *policy,
                                     ivl_state_t *state)
{
    core->init(port, LANE, cfg, state);
    if (!state->derived.cfg_good)
    {
        return IVL_SIM_REPLAY_BAD_CONFIG;
    }
    return (core->commit(port, LANE, cfg, state, policy) == IVL_OK) ? IVL_SIM_REPLAY_DONE : IVL_SIM_REPLAY_BAD_POLICY;
}

ivl_sim_replay_status_t ivl_sim_replay(const ivl_sim_model_t *model, const ivl_cfg_t *cfg, const ivl_policy_t *policy, const ivl_in_t *in,
                                       size_t n, ivl_sim_replay_row_t *rows)
{
    const ivl_sim_core_t *core = &model->core;
    void                 *port = core->open(core->context);
    ivl_state_t           state;
    memset(rows, 0, n * sizeof *rows);
    const ivl_sim_replay_status_t status = start(core, port, cfg, policy, &state);
    for (size_t i = 0; i < n && status == IVL_SIM_REPLAY_DONE; i++)
    {
        ivl_out_t out;
        core->step(port, LANE, cfg, &state, &in[i], &out);
        note(&state, &out, &rows[i]);
    }
    core->close(port);
    return status;
}
