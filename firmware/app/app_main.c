/// @file app_main.c
/// The app's task: talks to the host, and does what the stabilizer's task must not wait for.
#include "FreeRTOS.h"
#include "app.h"
#include "app_build.h"
#include "app_channel.h"
#include "app_convert.h"
#include "app_ivl.h"
#include "commander.h"
#include "crtp_commander_high_level.h"
#include "log.h"
#include "param.h"
#include "task.h"

#define DEBUG_MODULE "IVL"
#include "debug.h"

// The task wakes up this often even if the host is silent.
#define PERIOD_MS 5

// Time that the high-level commander gets to settle at the point of a hand-over.
static const float SETTLE_S = 0.5f;

typedef struct
{
    logVarId_t   variance[3];  ///< of the position, m^2
    paramVarId_t bypass;
    ivl_phase_t  last_phase;
} main_t;

static main_t task;

static float variance_m2(logVarId_t id)
{
    return logVarIdIsValid(id) ? logGetFloat(id) : NAN;
}

// values that the SDK gives by name only, which is too slow for the stabilizer's task
static void look_up(app_t *app, const main_t *m)
{
    atomic_store(&app->p_sigma_m, app_sigma_m(variance_m2(m->variance[0]), variance_m2(m->variance[1]), variance_m2(m->variance[2])));
    atomic_store(&app->motors_bypassed, !PARAM_VARID_IS_VALID(m->bypass) || (paramGetUint(m->bypass) != 0u));
}

// A set-point that the host streamed grows old when the host dies, and the supervisor would stop the motors of a landing vehicle for it.
// Given up, the high-level commander keeps the set-point fresh.
static void give_up_old_setpoint(main_t *m, ivl_phase_t phase)
{
    if ((phase == IVL_PHASE_ABORTED) && (m->last_phase != IVL_PHASE_ABORTED))
    {
        commanderRelaxPriority();
    }
    m->last_phase = phase;
}

// The high-level commander still stands where it was when the core took over: send it to where the vehicle is.
static void hold_where_handed_back(app_t *app)
{
    if (atomic_exchange(&app->was_handed_back, false) && !crtpCommanderHighLevelIsStopped())
    {
        const ivl_vec3_t p = app->in.p_WB_m;
        (void)crtpCommanderHighLevelGoTo(p.x, p.y, p.z, 0.0f, SETTLE_S, false);
    }
}

static void receive(app_t *app)
{
    uint8_t      bytes[APPCHANNEL_MTU];
    const size_t n = appchannelReceiveDataPacket(bytes, sizeof bytes, PERIOD_MS);
    if (n > 0u)
    {
        app_packets_handle(app, bytes, n);
    }
}

void app_task_start(void)
{
    task = (main_t){
        .variance = {logGetVarId("kalman", "varPX"), logGetVarId("kalman", "varPY"), logGetVarId("kalman", "varPZ")},
        .bypass = paramGetVarId("motorPowerSet", "enable"),
    };
    app_idle_find(&ivl_app);
    app_tumble_check_set(IVL_PHASE_IDLE);
    // by this text an image is known (ivl flash)
    DEBUG_PRINT("Inverted landing ready, build " APP_TEXT(IVL_BUILD) "\n");
}

void app_task_once(void)
{
    app_t *const app = &ivl_app;
    if (app_packets_waiting(app))
    {
        vTaskDelay(M2T(1));
    }
    else
    {
        receive(app);
    }
    app_packets_poll(app);
    look_up(app, &task);
    give_up_old_setpoint(&task, app->state.phase);
    hold_where_handed_back(app);
}

void appMain(void)
{
    app_task_start();
    for (;;)
    {
        app_task_once();
    }
}
