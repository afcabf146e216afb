/// @file cf.h
/// The vehicle behind the link server: one simulated Crazyflie with the flight core's app on board, as an operator and the app see it.
///
/// The server decodes packets into the calls below and asks for what the vehicle has to say; it owns sockets, tables of contents, log blocks
/// and wall-clock time.  The vehicle owns everything that flies.  Time passes in ivl_cf_step alone, and each run is a function of the sequence
/// of calls: no clock, no I/O, no memory taken after ivl_cf_open.
///
/// One vehicle a process, since the app has static memory.  Not re-entrant.  SI units, radians, world z up, unless a line says otherwise.
#ifndef IVL_CF_H
#define IVL_CF_H
#include "cf_planner.h"
#include "sim_model.h"
#include "world_rollout.h"

typedef struct ivl_cf        ivl_cf_t;
typedef struct ivl_cf_room_t ivl_cf_room_t;  ///< cf_room.h

// ---- life and time

/// The process's vehicle: on the floor below its start point, booted, motors off.
/// @param[in] model  is copied; its rate of the flight core must be one that the stabilizer has (1000, 500 or 250 Hz)
/// @param[in] seed   of noise outside landings that name their own
/// @param[out] error one line, if the result is NULL
/// @return NULL if the model cannot be flown, or if the vehicle is open already
ivl_cf_t *ivl_cf_open(const ivl_sim_model_t *model, uint64_t seed, char *error, size_t error_size);
void      ivl_cf_close(ivl_cf_t *cf);

/// One millisecond.  What the calls below hand over takes effect in the next one.
void ivl_cf_step(ivl_cf_t *cf);

/// Time since boot, us: 1000 times the number of steps.  Goes on through resets.
uint64_t ivl_cf_time_us(const ivl_cf_t *cf);

/// The processor loses its power: motors off, nothing is done or said, and the vehicle falls.
void ivl_cf_power_off(ivl_cf_t *cf);

/// It gets it again: it boots where it is.  Time goes on; parameters have their first values, but for the group sil and the decks.
void ivl_cf_power_on(ivl_cf_t *cf);

/// Last byte of the radio address, which the EEPROM shows; before the vehicle is used.
void ivl_cf_set_address(ivl_cf_t *cf, uint8_t address);

/// Into a room with others, as its vehicle number n: its start point is apart from theirs.  After ivl_cf_open, before tables are asked for.
/// @param[in] room  must outlast the vehicle
void ivl_cf_enter(ivl_cf_t *cf, ivl_cf_room_t *room, size_t n);

/// So much of the room's time has passed while the vehicle stood still: it has not lived through it, the others have.
void ivl_cf_skip(ivl_cf_t *cf, uint64_t us);

/// Put a deck on, by the name of its parameter without the group: bcFlow2 or bcMultiranger; before tables and memories are asked for.
/// @return false if there is no such deck
bool ivl_cf_attach(ivl_cf_t *cf, const char *name);

/// Whether a deck of this name can be put on.
bool ivl_cf_is_deck(const char *name);

/// Whether somebody listens; the server's own judgement (no packet for a second: false).
void ivl_cf_link(ivl_cf_t *cf, bool up);

// ---- parameters and log variables

/// Type codes of both tables.  A log type is given as its own code; the two families do not mix.
typedef enum
{
    IVL_CF_PARAM_I8 = 0x00,
    IVL_CF_PARAM_I16 = 0x01,
    IVL_CF_PARAM_I32 = 0x02,
    IVL_CF_PARAM_I64 = 0x03,
    IVL_CF_PARAM_F32 = 0x06,
    IVL_CF_PARAM_F64 = 0x07,
    IVL_CF_PARAM_U8 = 0x08,
    IVL_CF_PARAM_U16 = 0x09,
    IVL_CF_PARAM_U32 = 0x0A,
    IVL_CF_PARAM_U64 = 0x0B
} ivl_cf_param_type_t;

typedef enum
{
    IVL_CF_LOG_U8 = 1,
    IVL_CF_LOG_U16 = 2,
    IVL_CF_LOG_U32 = 3,
    IVL_CF_LOG_I8 = 4,
    IVL_CF_LOG_I16 = 5,
    IVL_CF_LOG_I32 = 6,
    IVL_CF_LOG_F32 = 7
} ivl_cf_log_type_t;

/// The value lies at `address` in the machine's own byte order.  A write copies the bytes there, then calls `changed`, if there is one.  The
/// vehicle may change a value by itself.
/// The default of a parameter is its value after ivl_cf_open.
typedef struct
{
    const char *group, *name;  ///< 24 characters together, at most
    uint8_t     type;          ///< ivl_cf_param_type_t
    bool        read_only;
    bool        persistent;
    bool        core;
    bool        held;  ///< there because every Crazyflie has it; without effect
    void       *address;
    void (*changed)(void);
} ivl_cf_param_t;

typedef struct
{
    const char *group, *name;
    uint8_t     type;  ///< ivl_cf_log_type_t
    const void *address;
    bool        core;
    bool        held;  ///< constant
} ivl_cf_log_t;

/// Tables of the vehicle; they do not change after ivl_cf_open.  The server may serve more of its own beside them.
const ivl_cf_param_t *ivl_cf_params(const ivl_cf_t *cf, size_t *n);
const ivl_cf_log_t   *ivl_cf_logs(const ivl_cf_t *cf, size_t *n);

/// Bring the values behind the log table up to date; before log variables are sampled.
void ivl_cf_logs_refresh(ivl_cf_t *cf);

// ---- memories

typedef struct
{
    uint8_t type;                                                          ///< 0x18 flight recorder, or one of IVL_CF_MEMORY_*
    uint32_t (*size)(void);                                                ///< bytes
    bool (*read)(uint32_t address, uint32_t size, uint8_t *bytes);         ///< false: not that range, or not now
    bool (*write)(uint32_t address, uint32_t size, const uint8_t *bytes);  ///< NULL: read-only
    uint8_t serial[8];                                                     ///< number of a 1-wire memory, else 0
} ivl_cf_memory_t;

const ivl_cf_memory_t *ivl_cf_memories(const ivl_cf_t *cf, size_t *n);

#define IVL_CF_MEMORY_OUTCOME 0x1Eu
#define IVL_CF_MEMORY_WORLD   0x1Fu        ///< ivl_sim_params_t: what is simulated, so that a host can compare
#define IVL_CF_OUTCOME_MAGIC  0x4F4C5649u  ///< "IVLO"

/// What the outcome memory begins with; an ivl_sim_outcome_t follows, all 0 before the first landing has ended.
typedef struct
{
    uint32_t magic;       ///< IVL_CF_OUTCOME_MAGIC
    uint32_t episode;     ///< number of the landing: log sil.episode while log sil.ended is 1; 0: none yet
    uint32_t size;        ///< of the outcome behind the header
    uint32_t policy_seq;  ///< of the policy that was flown
    uint32_t crc;         ///< ivl_wire_crc() of seed and stream of the landing (uint64_t each), and of the outcome
} ivl_cf_outcome_header_t;

// ---- text and packets

/// Text for the console, ASCII.  @return bytes written, at most `size`, 0 if there is nothing to say
size_t ivl_cf_console_take(ivl_cf_t *cf, char *text, size_t size);

enum
{
    IVL_CF_APP_BYTES = 30  ///< of an app channel packet, at most
};

/// A packet for the app.  @return false if it is too long, or the app's queue is full: then it is lost, as on the drone
bool ivl_cf_app_receive(ivl_cf_t *cf, const uint8_t *bytes, size_t size);

/// What the app has sent, one packet a call.  @return its size, 0 if there is none
size_t ivl_cf_app_take(ivl_cf_t *cf, uint8_t bytes[IVL_CF_APP_BYTES]);

// ---- supervisor

/// Flies a way of the high-level commander, and no set-point of a client has come since.
bool ivl_cf_flies_high_level(const ivl_cf_t *cf);

/// The bit field of packet 9/0.
uint16_t ivl_cf_supervisor_info(const ivl_cf_t *cf);

/// Arm or disarm.  @return true if the wish is granted
bool ivl_cf_arm(ivl_cf_t *cf, bool arm);

/// @return true if the vehicle is no longer crashed
bool ivl_cf_recover(ivl_cf_t *cf);
void ivl_cf_estop(ivl_cf_t *cf);

/// Once seen, it must be repeated within a second, or it stops the motors.
void ivl_cf_estop_watchdog(ivl_cf_t *cf);
bool ivl_cf_is_armed(const ivl_cf_t *cf);

// ---- commander: one call a set-point.  Angles here are degrees and thrust is 0..65535, as the packets have them.
// A value that is no number, or beyond what a vehicle can do, makes the call return false, and nothing changes.

/// The sticks of port 3, with all numbers as sent.  The flightmode.* parameters say what they mean: angles or rates, a point, or speeds.
bool ivl_cf_set_rpyt(ivl_cf_t *cf, float roll_deg, float pitch_deg, float yaw_deg, uint16_t thrust);
bool ivl_cf_set_stop(ivl_cf_t *cf);
bool ivl_cf_set_velocity(ivl_cf_t *cf, const float v_W_mps[3], float yawrate_degps);
bool ivl_cf_set_zdistance(ivl_cf_t *cf, float roll_deg, float pitch_deg, float yawrate_degps, float z_m);
bool ivl_cf_set_hover(ivl_cf_t *cf, float vx_B_mps, float vy_B_mps, float yawrate_degps, float z_m);
bool ivl_cf_set_position(ivl_cf_t *cf, const float p_W_m[3], float yaw_deg);
bool ivl_cf_set_althold(ivl_cf_t *cf, float roll_deg, float pitch_deg, float yawrate_degps, float vz_mps);
bool ivl_cf_set_manual(ivl_cf_t *cf, float roll_deg, float pitch_deg, float yawrate_degps, uint16_t thrust, bool rate);

/// Pulses of a radio control for roll, pitch, yaw and thrust, 1000 .. 2000 us.
/// @param[in] level  roll and pitch are angles, else rates
bool ivl_cf_set_cppm(ivl_cf_t *cf, const uint16_t pulse_us[4], bool level);

/// @param[in] q_WB  x, y, z, w; only its heading is followed
bool ivl_cf_set_full_state(ivl_cf_t *cf, const float p_W_m[3], const float v_W_mps[3], const float a_W_mps2[3], const float q_WB[4],
                           const float w_B_radps[3]);

/// Hand back to the high-level commander, at once: as in the stock firmware, remain_ms changes nothing.
void ivl_cf_notify_stop(ivl_cf_t *cf, uint32_t remain_ms);

// ---- high-level commander.  @return 0, or an errno, and a line on the console: EBUSY 16 when the vehicle cannot fly, EINVAL 22 for values that
// make no sense, EPERM 1 for a take-off in flight and a second landing, ENOEXEC 8 for a trajectory that cannot be flown

/// Groups of this vehicle, a bit each.
void ivl_cf_hl_group(ivl_cf_t *cf, uint8_t mask);

/// Whether a command to these groups, 0 being all, is meant for this vehicle.
bool ivl_cf_hl_is_meant(const ivl_cf_t *cf, uint8_t mask);

int ivl_cf_hl_takeoff(ivl_cf_t *cf, float height_m, float yaw_rad, bool use_current_yaw, float duration_s);
int ivl_cf_hl_land(ivl_cf_t *cf, float height_m, float yaw_rad, bool use_current_yaw, float duration_s);

/// With a mean speed instead of a duration.
/// @param[in] relative   height above, or when landing below, the present one
/// @param[in] speed_mps  0 or less: hlCommander.vtoff, hlCommander.vland
int ivl_cf_hl_takeoff_at(ivl_cf_t *cf, float height_m, bool relative, float yaw_rad, bool use_current_yaw, float speed_mps);
int ivl_cf_hl_land_at(ivl_cf_t *cf, float height_m, bool relative, float yaw_rad, bool use_current_yaw, float speed_mps);

/// @param[in] linear  at a steady speed, else from rest, or from the motion of the way before, to rest
int ivl_cf_hl_go_to(ivl_cf_t *cf, bool relative, bool linear, const float p_W_m[3], float yaw_rad, float duration_s);

/// More than two half turns, and radii below 0, are brought into range, as on the drone.
int ivl_cf_hl_spiral(ivl_cf_t *cf, const ivl_cf_spiral_t *spiral);
int ivl_cf_hl_stop(ivl_cf_t *cf);

/// Which part of the trajectory memory (type 12h) is which trajectory.
int ivl_cf_hl_define(ivl_cf_t *cf, uint8_t id, const ivl_cf_definition_t *definition);
int ivl_cf_hl_start(ivl_cf_t *cf, uint8_t id, const ivl_cf_start_t *how);

// ---- localization: used if parameter sil.pose_source is 1, counted always.  @return false for values that are no numbers

bool ivl_cf_ext_position(ivl_cf_t *cf, const float p_W_m[3]);

/// @param[in] q_WB  x, y, z, w, unit length within 5 %
bool ivl_cf_ext_pose(ivl_cf_t *cf, const float p_W_m[3], const float q_WB[4]);

#endif  // IVL_CF_H
