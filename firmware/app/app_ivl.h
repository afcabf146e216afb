/// @file app_ivl.h
/// The app's memory, and what its files ask of each other.
///
/// Four tasks meet here.  The stabilizer (priority 5, 1 kHz) runs the controller hooks, the core and the recorder, and never waits.
/// PARAM (priority 1) writes `staged`.  The app's own task (priority 1) talks to the host, that of CPX (priority 1) to a deck.  They pass
/// whole values through mailboxes: whoever fills one waits until it is empty, or gives up, and a reader that is faster than the writer finds
/// it either full or empty, never half filled.
#ifndef APP_IVL_H
#define APP_IVL_H
#include <stdatomic.h>

#include "app_port.h"
#include "app_senses.h"
#include "ivl_handover.h"
#include "ivl_parts.h"
#include "ivl_record.h"
#include "ivl_wire.h"
#include "param.h"

#define APP_CONFIG_NONE 255u  ///< no row of IVL_PARAMS

typedef struct
{
    uint32_t  seq;  ///< value that was written to ivl.commit
    ivl_cfg_t cfg;
} app_config_request_t;

typedef struct
{
    uint32_t seq;
    int8_t   status;  ///< ivl_wire_status_t
    uint8_t  bad;     ///< row of IVL_PARAMS, APP_CONFIG_NONE
} app_config_result_t;

/// A mailbox for one value of a type.
#define APP_MAILBOX(type)                                                                                                                  \
    struct                                                                                                                                 \
    {                                                                                                                                      \
        atomic_bool full;                                                                                                                  \
        type        value;                                                                                                                 \
    }

/// Who tells readings of a camera; each writes a mailbox of its own, from a task of its own.
typedef enum
{
    APP_CAMERA_CHANNEL,  ///< the app channel: a companion computer, a bench
    APP_CAMERA_CPX,      ///< a deck that speaks CPX
    APP_CAMERAS
} app_camera_t;

/// One reading of a camera; `t_us` is its sampling instant, as far as the sender knows it.
typedef struct
{
    ivl_reading_t rrev;
    ivl_reading_t flow;
} app_seen_t;

typedef enum
{
    APP_OWNER_STOCK,
    APP_OWNER_CORE
} app_owner_t;

typedef enum
{
    APP_WAITS_FOR_NOTHING,
    APP_WAITS_FOR_POLICY,
    APP_WAITS_FOR_COMMAND
} app_waits_t;

/// A packet that is being put in force.
typedef struct
{
    app_waits_t what;
    uint32_t    seq;
    uint32_t    since_ms;
} app_pending_t;

/// The SDK's parameter powerDist.idleThrust.
typedef struct
{
    paramVarId_t id;        ///< written by the app's task, before is_known
    atomic_bool  is_known;  ///< there is such a parameter; written by the app's task
    bool         is_off;    ///< it is 0, since the core stops motors
    unsigned int found;     ///< what it was before
} app_idle_t;

/// Written by the stabilizer's task alone, unless a line says otherwise; others may read single numbers for logs.
typedef struct
{
    bool booted;

    // the core
    ivl_cfg_t      cfg;
    ivl_state_t    state;
    ivl_in_t       in;
    ivl_out_t      out;
    ivl_recorder_t recorder;

    // what is sensed
    app_senses_t  senses;
    uint64_t      t_link_us;        ///< when the link was last up
    uint64_t      t_host_us;        ///< when the host last sent a command
    bool          has_host;         ///< it ever did
    _Atomic float p_sigma_m;        ///< written by the app's task
    app_seen_t    seen;             ///< by a camera, of the latest sampling instant; zero without one
    atomic_bool   motors_bypassed;  ///< written by the app's task
    bool          configured;       ///< a configuration was put in force since the start
    bool          starts_on_path;   ///< a simulated landing: an approach puts the vehicle on its path, whatever it did before

    // who drives the motors
    app_owner_t    owner;
    ivl_handover_t handover;
    float          collective_norm;  ///< mean thrust of the last tick, of either owner
    atomic_bool    was_handed_back;  ///< in flight, to the stock controller; cleared by the app's task

    app_idle_t idle;

    // between tasks
    ivl_cfg_t staged;                                ///< what PARAM writes
    uint32_t  commit;                                ///< the parameter ivl.commit
    APP_MAILBOX(app_config_request_t) config_in;     ///< PARAM to stabilizer
    APP_MAILBOX(app_config_result_t) config_out;     ///< stabilizer to app
    APP_MAILBOX(ivl_policy_t) policy_in;             ///< app to stabilizer
    APP_MAILBOX(ivl_wire_policy_echo_t) policy_out;  ///< stabilizer to app
    APP_MAILBOX(ivl_command_t) command_in;           ///< app to stabilizer
    APP_MAILBOX(app_seen_t) seen_in[APP_CAMERAS];    ///< app, or the deck's task, to stabilizer
    app_config_result_t config_result;               ///< last one, for logs; written by the app's task
    uint32_t            config_crc;                  ///< of the configuration in force; written by the app's task
    uint32_t            n_bad_packet;                ///< packets that were none of ours; written by the app's task
    _Atomic uint32_t    n_reading;                   ///< readings of a camera that were passed on; written by the senders' tasks
    _Atomic uint32_t    n_reading_bad;               ///< and that were refused
    app_pending_t       pending;                     ///< of the app's task
    uint16_t            command_seq;                 ///< of the app's task: number of the last command that was taken
    bool                has_command;                 ///< of the app's task: there was one
    ivl_parts_t         parts;                       ///< of the app's task: the policy that is arriving
    int                 n_config_polls;              ///< of the app's task: how often a commit was found waiting
} app_t;

extern app_t ivl_app;

// ---- the stabilizer's task, in every port (app_tick.c)

/// Once after power-on, with app->cfg as it was flashed and the rest of the memory zero.
void app_ready(app_t *app);

/// Start or restart the core.  After a restart in the air, motors stay with it, and off, until the vehicle has rested.
void app_start_core(app_t *app);

/// Empty the mailboxes of the other tasks; once a millisecond.
void app_take_requests(app_t *app, uint64_t now_us);

/// What the core is told about the vehicle beside its motion; before app_step.
void app_look_around(app_t *app, bool stock_idle, float setpoint_age_s, uint64_t now_us);

/// One tick of the core on app->in, its row of the recorder, and the tumble check.
void app_step(app_t *app);

/// The core drives in this call: what is to be added to each motor while a step of thrust fades, as a share of the largest.
/// @param[in] mean_norm  mean thrust that the core asks for
/// @param[in] loop_s     time between two calls
float app_fade_into_core(app_t *app, float mean_norm, float loop_s);

/// The stock controller drives in this call: its thrust, with what fades; none stays none.
float app_fade_into_stock(app_t *app, float norm, float loop_s);

// ---- between tasks

/// Fill a mailbox if it is empty.  @return true if it was
#define app_put(box, what) (atomic_load(&(box)->full) ? false : ((box)->value = (what), atomic_store(&(box)->full, true), true))

/// Empty a mailbox into *what if it is full.  @return true if it was
#define app_take(box, what) (atomic_load(&(box)->full) ? (*(what) = (box)->value, atomic_store(&(box)->full, false), true) : false)

/// Default configuration of this platform: the core's, with what the SDK knows about the airframe.
void app_config_defaults(ivl_cfg_t *cfg);

/// Check and put in force, in the stabilizer's task.  Beyond ivl_cfg_check, the platform must be able to do it: a rate that the stabilizer
/// has, and no more thrust than its largest.
app_config_result_t app_config_apply(app_t *app, const app_config_request_t *request);

/// What to do about the row of a refused configuration, where that is more than another value; "" else.
const char *app_config_remedy(uint8_t bad);

/// The values in force come back into the parameters, and clients are told of each that was another one.  In the app's task.
void app_config_take_back(app_t *app);

/// Registered once, before the system starts.
void app_memory_register(void);

/// The tumble check of the SDK's supervisor: off in flip and coast only.
void app_tumble_check_set(ivl_phase_t phase);

/// Find the SDK's idle thrust (app_idle.c).  In the app's task, once at the start.
void app_idle_find(app_t *app);

/// No idle thrust where the core stops motors.  In the stabilizer's task, after app_step.
void app_idle_step(app_t *app);

/// One packet of the host, in the app's task: hand it to the stabilizer's task.  Not while app_packets_waiting.
void app_packets_handle(app_t *app, const uint8_t *bytes, size_t size);

/// True while the stabilizer's task has yet to take what a packet asked for.
bool app_packets_waiting(const app_t *app);

/// Answer what has been done or cannot be; once a millisecond while app_packets_waiting, else every few.
void app_packets_poll(app_t *app);

// ---- readings of a camera (app_reading.c)

/// Check a reading and hand it to the stabilizer's task; counts it as passed on or refused.  In the task of its sender.
void app_reading_put(app_t *app, app_camera_t camera, const ivl_wire_reading_t *packet, uint64_t now_us);

/// In the stabilizer's task: keep what the cameras have told since the last call, unless it was sampled before what is kept.
void app_reading_take(app_t *app);

/// In the stabilizer's task: put what is kept into app->in where it was sampled after what stands there.
void app_reading_show(app_t *app);

/// Listen to a deck that speaks CPX (app_cpx.c).  Once, at the start.
void app_cpx_start(void);
#endif  // APP_IVL_H
