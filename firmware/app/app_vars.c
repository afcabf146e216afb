/// @file app_vars.c
/// Parameters and logs of the core, from the tables of ivl_vars.h.  Writes go to a staged copy, which ivl.commit puts in force as a whole.
#include <string.h>

#include "app_build.h"
#include "app_convert.h"
#include "app_ivl.h"
#include "log.h"
#include "param.h"

// ---- configuration

void app_config_defaults(ivl_cfg_t *cfg)
{
    ivl_cfg_defaults(cfg);
    cfg->mass_kg = CF_MASS;
    cfg->arm_x_m = app_motor_offset_m();
    cfg->arm_y_m = app_motor_offset_m();
    cfg->torque_per_thrust_m = THRUST2TORQUE;
    cfg->motor_thrust_N_max = THRUST_MAX;
}

#define ROW(ctype, group, name, field, unit, min, max, dflt, doc) ROW_##field,
enum
{
    IVL_PARAMS(ROW) ROW_COUNT
};
_Static_assert(ROW_COUNT < (int)APP_CONFIG_NONE, "a row fits into a byte");

// what this platform cannot do; -1 if it can do all
static int bad_for_platform(const ivl_cfg_t *cfg)
{
    if (!app_has_rate(cfg->tick_hz))
    {
        return ROW_tick_hz;
    }
    return (cfg->motor_thrust_N_max <= THRUST_MAX) ? -1 : ROW_motor_thrust_N_max;
}

app_config_result_t app_config_apply(app_t *app, const app_config_request_t *request)
{
    const int    bad_core = ivl_cfg_bad_row(&request->cfg);
    const int    bad = (bad_core >= 0) ? bad_core : bad_for_platform(&request->cfg);
    ivl_status_t status = IVL_ERR_RANGE;
    if (bad < 0)
    {
        status = ivl_reconfigure(&app->cfg, &app->state, &request->cfg);
        app->configured = app->configured || (status == IVL_OK);
    }
    return (app_config_result_t){request->seq, (int8_t)status, (bad < 0) ? (uint8_t)APP_CONFIG_NONE : (uint8_t)bad};
}

const char *app_config_remedy(uint8_t bad)
{
    return (bad == (uint8_t)ROW_motor_thrust_N_max) ? ": more than the motors that this image was configured for (make -C firmware)" : "";
}

/// Each row has a setter of its type by its own name; comparing bytes also finds what is no number.
static void take_back_float(const char *name, const float *staged, float in_force)
{
    if (memcmp(staged, &in_force, sizeof in_force) != 0)
    {
        paramSetFloat(paramGetVarId("ivl", name), in_force);
    }
}

static void take_back_uint8_t(const char *name, const uint8_t *staged, uint8_t in_force)
{
    if (*staged != in_force)
    {
        paramSetInt(paramGetVarId("ivl", name), in_force);
    }
}

#define TAKE_BACK(ctype, group, row_name, field, unit, min, max, dflt, doc) take_back_##ctype(row_name, &app->staged.field, app->cfg.field);

void app_config_take_back(app_t *app)
{
    IVL_PARAMS(TAKE_BACK)
}

// runs in the PARAM task, after the write of ivl.commit; a commit that is still waiting is not overwritten
static void commit_written(void)
{
    app_t *const app = &ivl_app;
    if (!atomic_load(&app->config_in.full))
    {
        app->config_in.value.seq = app->commit;
        app->config_in.value.cfg = app->staged;
        atomic_store(&app->config_in.full, true);
    }
}

// ---- tables of the SDK: its own macros make a name from a token, these rows have it as a string already

static const uint32_t BUILD = IVL_BUILD;

#define PARAM_TYPE_OF_float   PARAM_FLOAT
#define PARAM_TYPE_OF_uint8_t PARAM_UINT8
#define PARAM_ROW(ctype, group, row_name, field, unit, min, max, dflt, doc)                                                                \
    {.type = PARAM_TYPE_OF_##ctype, .name = row_name, .address = (void *)&ivl_app.staged.field},

PARAM_GROUP_START(ivl)
IVL_PARAMS(PARAM_ROW)
/**
 * @brief Any number: check all parameters of this group and put them in force together.  The answer is in ivl.cfg_status, and in a packet
 * of the app channel.  Refused in flight, and when a value is out of range or no number; then the values in force come back.
 */
PARAM_ADD_WITH_CALLBACK(PARAM_UINT32, commit, &ivl_app.commit, commit_written)
/**
 * @brief Number of the app's build, a checksum of its sources; 0 in a simulated vehicle
 */
PARAM_ADD(PARAM_UINT32 | PARAM_RONLY, build, &BUILD)
PARAM_GROUP_STOP(ivl)

#define LOG_TYPE_OF_float       LOG_FLOAT
#define LOG_TYPE_OF_uint8_t     LOG_UINT8
#define LOG_TYPE_OF_uint16_t    LOG_UINT16
#define LOG_TYPE_OF_uint32_t    LOG_UINT32
#define VARIABLE_OF_ivl_out_t   ivl_app.out
#define VARIABLE_OF_ivl_state_t ivl_app.state
#define LOG_ROW(ctype, group, row_name, owner, field, unit, doc)                                                                           \
    {.type = LOG_TYPE_OF_##ctype, .name = row_name, .address = (void *)&VARIABLE_OF_##owner.field},

LOG_GROUP_START(ivl)
IVL_LOGS(LOG_ROW)
/**
 * @brief Value of ivl.commit that was answered last
 */
LOG_ADD(LOG_UINT32, cfg_seq, &ivl_app.config_result.seq)
/**
 * @brief Its answer: 0 in force, -1 a value was refused, -2 not in this phase, -3 another controller is selected
 */
LOG_ADD(LOG_INT8, cfg_status, &ivl_app.config_result.status)
/**
 * @brief Row of the parameter that was refused, 255 if none was
 */
LOG_ADD(LOG_UINT8, cfg_bad, &ivl_app.config_result.bad)
/**
 * @brief CRC-32 of the configuration in force
 */
LOG_ADD(LOG_UINT32, cfg_crc, &ivl_app.config_crc)
/**
 * @brief Packets of the app channel that were not understood
 */
LOG_ADD(LOG_UINT32, n_bad_packet, &ivl_app.n_bad_packet)
/**
 * @brief Readings of a camera that were passed on to the core
 */
LOG_ADD(LOG_UINT32, n_reading, &ivl_app.n_reading)
/**
 * @brief Readings of a camera that were refused: no number, out of range, too old, sooner than a millisecond after the last one, or (over
 * CPX) not understood
 */
LOG_ADD(LOG_UINT32, n_reading_bad, &ivl_app.n_reading_bad)
LOG_GROUP_STOP(ivl)
