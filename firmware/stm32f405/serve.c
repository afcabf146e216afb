#include "serve.h"

#include <string.h>

#include "semihost.h"

static _Noreturn void refuse(const char *why)
{
    semihost_print(why);
    semihost_exit(EXIT_PROTOCOL);
}

void serve_request(serve_core_t cores[IVL_PORT_SLOTS], serve_step_t step, const ivl_port_request_t *request, ivl_port_reply_t *reply)
{
    if (request->slot >= IVL_PORT_SLOTS)
    {
        refuse("request: no such slot\n");
    }
    serve_core_t *core = &cores[request->slot];
    if (!core->started && (request->operation != IVL_PORT_INIT))
    {
        refuse("request: the slot was never started\n");
    }
    memset(reply, 0, sizeof *reply);
    switch (request->operation)
    {
    case IVL_PORT_INIT:
        core->cfg = request->with.cfg;
        core->n_request = 0;
        core->started = true;
        ivl_init(&core->cfg, &core->state);
        break;
    case IVL_PORT_COMMIT:
        reply->status = ivl_policy_commit(&core->cfg, &core->state, &request->with.policy);
        break;
    case IVL_PORT_STEP:
        step(&core->cfg, &core->state, &request->with.in, &reply->out);
        break;
    default:
        refuse("request: no such operation\n");
    }
    reply->n_request = core->n_request++;
    reply->state = core->state;
}
