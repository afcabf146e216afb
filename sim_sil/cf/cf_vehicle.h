/// @file cf_vehicle.h
/// The vehicle's memory, and what its files ask of each other.  The server sees cf.h alone.
#ifndef IVL_CF_VEHICLE_H
#define IVL_CF_VEHICLE_H
#include "app_port.h"
#include "cf.h"
#include "cf_estimate.h"
#include "cf_planner.h"
#include "cf_power.h"
#include "cf_queue.h"
#include "cf_stock.h"
#include "cf_supervisor.h"
#include "sim_autopilot.h"

enum
{
    IVL_CF_LANE = 0,  ///< of the group
    IVL_CF_CONTROLLER_STOCK = 1,
    IVL_CF_CONTROLLER_APP = 6,
    IVL_CF_ESTIMATOR_KALMAN = 2,
    IVL_CF_START_AS_FLOWN = 255,
    IVL_CF_PLANNER_MS = 10,
    IVL_CF_SUPERVISOR_MS = 40
};

/// Parameters that are nothing but numbers.
typedef struct
{
    uint8_t  controller, estimator;
    uint8_t  reset, start, pose_source;
    uint32_t seed_lo, seed_hi, stream_lo, stream_hi;
    double   d_ceil_m, speed_mps, angle_deg;
    float    start_x_m, start_y_m, start_z_m;
    float    vbat_V;
    uint8_t  bypass;  ///< motorPowerSet.enable
    uint16_t bypass_pwm[4];
    uint8_t  alt_hold, pos_hold, stab_roll, stab_pitch, stab_yaw;
    float    ext_pos_sigma_m, ext_quat_sigma_rad;
    uint8_t  reset_estimation, prop_test, battery_test;
    uint8_t  ring_effect, ring_n_effect, ring_headlight, high_level;
    uint8_t  no_deck, deck;
    uint32_t revision0;
    uint16_t revision1;
    uint8_t  modified;
    int8_t   selftest_passed;
} ivl_cf_settings_t;

/// Landings.
typedef struct
{
    uint32_t                number;   ///< begun since boot
    bool                    running;  ///< the last one is not over
    uint8_t                 ended;    ///< it is over and its outcome stands below; a reset clears this
    uint32_t                policy_seq;
    uint64_t                draws[2];  ///< seed and stream of the last one
    ivl_sim_outcome_t       now;       ///< of the one that runs
    ivl_cf_outcome_header_t header;    ///< of the last that has ended
    ivl_sim_outcome_t       outcome;
} ivl_cf_episode_t;

struct ivl_cf
{
    bool                is_open;
    ivl_sim_model_t     model;
    ivl_sim_group_t     group;
    uint64_t            seed;
    uint64_t            t_ms;
    uint32_t            tick_ms;  ///< of the world and the core
    uint64_t            zero_us;  ///< vehicle time at which the world's clock was 0
    uint64_t            n_reset;
    bool                grounded;  ///< rests on the floor
    bool                link_up;
    bool                runs_stock;  ///< the stock controller is selected
    uint64_t            app_wake_ms;
    ivl_cf_settings_t   set;
    ivl_cf_supervisor_t supervisor;
    ivl_cf_commander_t  commander;
    ivl_cf_planner_t    planner;
    ivl_cf_stock_t      stock;
    ivl_cf_estimate_t   estimate;
    ivl_cf_power_t      power;
    ivl_cf_episode_t    episode;
    ivl_in_t            sensed;  ///< of the last tick, in vehicle time
    ivl_sim_told_t      told;
    sensorData_t        sensors;  ///< what the SDK hands round since the last tick
    state_t             state;
    ivl_cf_setpoint_t   setpoint;  ///< of the last call of the controller
    control_t           control, stock_control;
    float               acc_share;   ///< of the filter, a tick
    float               acc_g[3];    ///< filtered
    float               motor_N[4];  ///< commands of the last tick
    float               variance_m2;
    bool                has_range;    ///< the world has a ranging sensor
    uint16_t            range_up_mm;  ///< its last reading, or what one would say
    ivl_cf_text_t       text;
    ivl_cf_packets_t    to_app, from_app;
    size_t              changed[IVL_CF_CHANGED_MAX];
    size_t              n_changed;
};

/// The vehicle of this process.
extern ivl_cf_t ivl_cf_the;

static inline uint32_t ivl_cf_now_ms(const ivl_cf_t *cf)
{
    return (uint32_t)cf->t_ms;
}

static inline ivl_sim_world_t *ivl_cf_world(ivl_cf_t *cf)
{
    return &cf->group.world[IVL_CF_LANE];
}

// ---- cf_senses.c

/// Sensors and estimator have a tick of the world.
void ivl_cf_sense(ivl_cf_t *cf, const ivl_in_t *in);

// ---- cf_stabilizer.c

/// Where the world's core runs: the app, or the stock controller.
extern const ivl_sim_core_t ivl_cf_core;

/// One call of the controller, between two ticks of the world.
void ivl_cf_stabilize(ivl_cf_t *cf);

// ---- cf_world.c

/// On the floor at (x, y) of the start point.
void ivl_cf_world_boot(ivl_cf_t *cf);

/// One tick of the world; time passes before it.
void ivl_cf_world_tick(ivl_cf_t *cf);

/// Hovering at the start point, armed, in flight.
void ivl_cf_world_reset(ivl_cf_t *cf);

// ---- cf_episode.c

/// After a tick in which the app has begun an approach.
void ivl_cf_episode_begin(ivl_cf_t *cf);

/// Between two ticks.
void ivl_cf_episode_look(ivl_cf_t *cf);

// ---- cf_command.c

/// Set-points of the planner, at its rate.
void ivl_cf_plan(ivl_cf_t *cf);

/// The present set-point as the supervisor lets it pass.
ivl_cf_setpoint_t ivl_cf_setpoint(const ivl_cf_t *cf);
void              ivl_cf_relax(ivl_cf_t *cf);

// ---- cf_tables.c

/// Builds the tables.  @return false if they do not hold what the app brings
bool ivl_cf_tables_open(ivl_cf_t *cf);

/// The vehicle has changed a parameter of its own.
void ivl_cf_param_changed(ivl_cf_t *cf, const void *address);

// ---- cf_sdk.c

const ivl_cf_memory_t *ivl_cf_app_memory(void);
void                   ivl_cf_print(const char *format, ...) __attribute__((format(printf, 1, 2)));

#endif  // IVL_CF_VEHICLE_H
