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
#include "sim_model.h"
#include "world_rollout.h"

typedef struct ivl_cf ivl_cf_t;

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

/// The value lies at `address` in the machine's own byte order.  A write copies the bytes there, then calls `changed`, if there is one.
/// The default of a parameter is its value after ivl_cf_open.
typedef struct
{
    const char *group, *name;  ///< 24 characters together, at most
    uint8_t     type;          ///< ivl_cf_param_type_t
    bool        read_only;
    bool        persistent;
    bool        core;
    void       *address;
    void (*changed)(void);
} ivl_cf_param_t;

typedef struct
{
    const char *group, *name;
    uint8_t     type;  ///< ivl_cf_log_type_t
    const void *address;
} ivl_cf_log_t;

/// Tables of the vehicle; they do not change after ivl_cf_open.  The server may serve more of its own beside them.
const ivl_cf_param_t *ivl_cf_params(const ivl_cf_t *cf, size_t *n);
const ivl_cf_log_t   *ivl_cf_logs(const ivl_cf_t *cf, size_t *n);

/// Bring the values behind the log table up to date; before log variables are sampled.
void ivl_cf_logs_refresh(ivl_cf_t *cf);

/// Parameters that the vehicle itself has changed since the last call, one a call.  @return false if there are no more
bool ivl_cf_param_take_changed(ivl_cf_t *cf, size_t *index);

// ---- memories

typedef struct
{
    uint8_t type;                                                          ///< 0x18 flight recorder, or one of IVL_CF_MEMORY_*
    uint32_t (*size)(void);                                                ///< bytes
    bool (*read)(uint32_t address, uint32_t size, uint8_t *bytes);         ///< false: not that range, or not now
    bool (*write)(uint32_t address, uint32_t size, const uint8_t *bytes);  ///< NULL: read-only
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

bool ivl_cf_set_rpyt(ivl_cf_t *cf, float roll_deg, float pitch_deg, float yawrate_degps, uint16_t thrust);  ///< pitch as sent
bool ivl_cf_set_stop(ivl_cf_t *cf);
bool ivl_cf_set_velocity(ivl_cf_t *cf, const float v_W_mps[3], float yawrate_degps);
bool ivl_cf_set_zdistance(ivl_cf_t *cf, float roll_deg, float pitch_deg, float yawrate_degps, float z_m);
bool ivl_cf_set_hover(ivl_cf_t *cf, float vx_B_mps, float vy_B_mps, float yawrate_degps, float z_m);
bool ivl_cf_set_position(ivl_cf_t *cf, const float p_W_m[3], float yaw_deg);
bool ivl_cf_set_manual(ivl_cf_t *cf, float roll_deg, float pitch_deg, float yawrate_degps, uint16_t thrust, bool rate);

/// @param[in] q_WB  x, y, z, w; only its heading is followed
bool ivl_cf_set_full_state(ivl_cf_t *cf, const float p_W_m[3], const float v_W_mps[3], const float a_W_mps2[3], const float q_WB[4],
                           const float w_B_radps[3]);

/// Hand back to the high-level commander, at once: as in the stock firmware, remain_ms changes nothing.
void ivl_cf_notify_stop(ivl_cf_t *cf, uint32_t remain_ms);

// ---- high-level commander.  @return 0, or an errno: EBUSY 16 when the vehicle cannot fly, EINVAL 22 for values that make no sense, EPERM 1
// for a take-off in flight and a landing on the floor

int ivl_cf_hl_takeoff(ivl_cf_t *cf, float height_m, float yaw_rad, bool use_current_yaw, float duration_s);
int ivl_cf_hl_land(ivl_cf_t *cf, float height_m, float yaw_rad, bool use_current_yaw, float duration_s);
int ivl_cf_hl_go_to(ivl_cf_t *cf, bool relative, bool linear, const float p_W_m[3], float yaw_rad, float duration_s);
int ivl_cf_hl_stop(ivl_cf_t *cf);

// ---- localization: used if parameter sil.pose_source is 1, counted always.  @return false for values that are no numbers

bool ivl_cf_ext_position(ivl_cf_t *cf, const float p_W_m[3]);

/// @param[in] q_WB  x, y, z, w, unit length within 5 %
bool ivl_cf_ext_pose(ivl_cf_t *cf, const float p_W_m[3], const float q_WB[4]);

#endif  // IVL_CF_H
