/// @file cf_vehicle.h
/// The vehicle's memory, and what its files ask of each other.  The server sees cf.h alone.
#ifndef IVL_CF_VEHICLE_H
#define IVL_CF_VEHICLE_H
#include "app_port.h"
#include "cf.h"
#include "cf_estimate.h"
#include "cf_names.h"
#include "cf_planner.h"
#include "cf_power.h"
#include "cf_queue.h"
#include "cf_room.h"
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
    IVL_CF_PLACE_AT_START = 2,
    IVL_CF_IDLE_PWM = 7000,  ///< powerDist.idleThrust of a vehicle with brushless motors
    IVL_CF_PLANNER_MS = 10,
    IVL_CF_SUPERVISOR_MS = 40,
    IVL_CF_EEPROM_BYTES = 8192,
    IVL_CF_DECKS = 2,  ///< that can be attached
    IVL_CF_ONE_WIRE_BYTES = 112
};

/// What the ends of a radio control's sticks mean.
typedef struct
{
    float roll_degps, pitch_degps, yaw_degps;
    float roll_deg, pitch_deg;
} ivl_cf_cppm_t;

/// Parameters of the simulation.
typedef struct
{
    uint8_t  reset, place, start, pose_source;
    uint32_t seed_lo, seed_hi, stream_lo, stream_hi;
    double   d_ceil_m, speed_mps, angle_deg;
    float    start_x_m, start_y_m, start_z_m;
    float    wall_x_m, wall_y_m;  ///< walls at +- this, 0: none
    float    vbat_V;
    float    cell_V;  ///< open-circuit voltage of the battery that drives the motors, 0: as the model has it
} ivl_cf_simulation_t;

/// Parameters that are nothing but numbers.
typedef struct
{
    ivl_cf_simulation_t sim;
    uint8_t             controller, estimator;
    uint8_t             bypass;  ///< motorPowerSet.enable
    uint16_t            bypass_pwm[4];
    uint32_t            idle_pwm;  ///< of armed motors; IVL_CF_IDLE_PWM makes the vehicle's rotor.thrust_idle
    uint8_t             alt_hold, pos_hold, pos_set, stab_roll, stab_pitch, stab_yaw, yaw_mode;
    uint8_t             group_mask;  ///< of the high-level commander
    float               takeoff_mps, landing_mps;
    ivl_cf_cppm_t       cppm;
    float               ext_pos_sigma_m;
    float               initial_m[3], initial_yaw_rad;  ///< where the estimate begins after a reset
    uint8_t             reset_estimation, prop_test, battery_test;
    uint8_t             task_dump, assert_info, storage_stats, tester_reset;
    uint8_t             high_level;
    uint8_t             has_flow_deck, has_ranger_deck;
    float               low_V;
    uint32_t            cpu_id[3];
    int8_t              selftest_passed;
} ivl_cf_settings_t;

/// Where distance sensors look, in body axes.
typedef enum
{
    IVL_CF_FRONT,
    IVL_CF_BACK,
    IVL_CF_LEFT,
    IVL_CF_RIGHT,
    IVL_CF_UP,
    IVL_CF_DOWN,
    IVL_CF_DIRECTIONS
} ivl_cf_direction_t;

/// Types of the list of names.
typedef uint8_t  ivl_cf_ctype_U8;
typedef uint16_t ivl_cf_ctype_U16;
typedef uint32_t ivl_cf_ctype_U32;
typedef int8_t   ivl_cf_ctype_I8;
typedef int16_t  ivl_cf_ctype_I16;
typedef int32_t  ivl_cf_ctype_I32;
typedef float    ivl_cf_ctype_F32;
typedef double   ivl_cf_ctype_F64;

#define IVL_CF_NOTHING(...)
#define IVL_CF_MEMBER(type_, group_, name_, access, value) ivl_cf_ctype_##type_ group_##_##name_;

/// Values of the parameters that are held.
typedef struct
{
    IVL_CF_PARAMS(IVL_CF_NOTHING, IVL_CF_MEMBER)
} ivl_cf_held_t;

/// Landings.
typedef struct
{
    uint32_t                number;   ///< begun since boot
    bool                    running;  ///< the last one is not over
    uint8_t                 ended;    ///< it is over and its outcome stands below; a reset clears this
    uint32_t                policy_seq;
    uint64_t                draws[2];   ///< seed and stream of the last one
    float                   battery_V;  ///< of the rotors' battery when the last one began; 0: a supply that never sags
    ivl_sim_outcome_t       now;        ///< of the one that runs
    ivl_cf_outcome_header_t header;     ///< of the last that has ended
    ivl_sim_outcome_t       outcome;
} ivl_cf_episode_t;

struct ivl_cf
{
    bool                is_open;
    bool                is_on;  ///< its processor has power
    ivl_sim_model_t     model;
    ivl_sim_group_t     group;
    uint64_t            seed;
    uint64_t            t_ms;
    uint32_t            tick_ms;  ///< of the world and the core
    uint64_t            zero_us;  ///< vehicle time at which the world's clock was 0
    uint64_t            n_reset;
    bool                grounded;  ///< rests on the floor
    ivl_cf_room_t      *room;      ///< with other vehicles; NULL: it is alone
    size_t              room_seat;
    uint64_t            skipped_us;                      ///< of the room's time
    uint32_t            n_bumps;                         ///< with other vehicles
    uint64_t            apart_us[IVL_CF_ROOM_VEHICLES];  ///< of each of them: no bump before that, in the room's time
    bool                link_up;
    bool                runs_stock;  ///< the stock controller is selected
    uint64_t            app_wake_ms;
    ivl_cf_settings_t   set;
    ivl_cf_held_t       held;
    ivl_cf_supervisor_t supervisor;
    ivl_cf_commander_t  commander;
    ivl_cf_planner_t    planner;
    ivl_cf_stock_t      stock;
    ivl_cf_estimate_t   estimate;
    ivl_cf_frame_t      frame;  ///< of the estimate, if it is not the world's
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
    bool                has_range;                    ///< the world has a ranging sensor
    uint16_t            range_mm[IVL_CF_DIRECTIONS];  ///< last readings
    bool                range_begun;                  ///< the multi-ranger measures from there
    uint64_t            range_from_us;                ///< in the room's time
    ivl_sim_kin_t       range_from;
    int16_t             flow_pixels[2];  ///< deltaX, deltaY of the flow sensor
    uint8_t             eeprom[IVL_CF_EEPROM_BYTES];
    uint8_t             one_wire[IVL_CF_DECKS][IVL_CF_ONE_WIRE_BYTES];  ///< of the decks that are on
    uint32_t            tester_errors;  ///< bytes written to the memory tester that were not those it expects
    ivl_cf_text_t       text;
    ivl_cf_packets_t    to_app, from_app;
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

/// The estimator begins anew: at kalman.initial*, if they are not all 0, else where the vehicle is.
void ivl_cf_begin_estimate(ivl_cf_t *cf);

/// Sensors and estimator have a tick of the world.
void ivl_cf_sense(ivl_cf_t *cf, const ivl_in_t *in);

// ---- cf_stabilizer.c

/// Where the world's core runs: the app, or the stock controller.
extern const ivl_sim_core_t ivl_cf_core;

/// One call of the controller, between two ticks of the world.
void ivl_cf_stabilize(ivl_cf_t *cf);

/// A motor is asked for more than its idle thrust: what the supervisor takes for flying.
bool ivl_cf_motors_run(const ivl_cf_t *cf);

// ---- cf_world.c

/// On the floor at (x, y) of the start point.
void ivl_cf_world_boot(ivl_cf_t *cf);

/// One tick of the world; time passes before it.
void ivl_cf_world_tick(ivl_cf_t *cf);

/// Hovering at the start point, armed, in flight.
void ivl_cf_world_reset(ivl_cf_t *cf);

/// Taken by hand from wherever it is, and put down upright on the floor, its heading kept; what it flew is over.
/// @param[in] at_start  at (x, y) of the start point, not below where it was
void ivl_cf_world_place(ivl_cf_t *cf, bool at_start);

// ---- cf_neighbours.c: nothing happens where a vehicle is alone

/// Time that the vehicles of a room share.
uint64_t ivl_cf_room_us(const ivl_cf_t *cf);

/// Where the vehicle is, for the others.  At each tick of the world.
void ivl_cf_neighbours_tell(ivl_cf_t *cf);

/// Another vehicle in the cone of a distance sensor that looks along b_W, if it is nearer than *nearest_m.
void ivl_cf_neighbours_look(const ivl_cf_t *cf, uint64_t t_us, const double p_W_m[3], const double b_W[3], double *nearest_m);

/// Running into others.  Between two ticks.
void ivl_cf_neighbours_bump(ivl_cf_t *cf);

// ---- cf_decks.c

/// Nothing has been measured yet.
void ivl_cf_decks_boot(ivl_cf_t *cf);

/// What is measured on the decks, a millisecond after the one before.
void ivl_cf_decks_step(ivl_cf_t *cf);
bool ivl_cf_has_deck(const ivl_cf_t *cf, size_t deck);

// ---- cf_memories.c

/// As it comes from the factory, with the last byte of the radio address.
void ivl_cf_eeprom_init(ivl_cf_t *cf, uint8_t address);

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

/// Held parameters have their first values.
void ivl_cf_tables_boot(ivl_cf_t *cf);

// ---- cf_sdk.c

const ivl_cf_memory_t *ivl_cf_app_memory(void);
void                   ivl_cf_print(const char *format, ...) __attribute__((format(printf, 1, 2)));

#endif  // IVL_CF_VEHICLE_H
