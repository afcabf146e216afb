/// @file cf_supervisor.h
/// The stock firmware's supervisor: may the motors run, and what must happen before they may again.  25 Hz.
#ifndef IVL_CF_SUPERVISOR_H
#define IVL_CF_SUPERVISOR_H
#include <stdbool.h>
#include <stdint.h>

typedef enum
{
    IVL_CF_STATE_BOOT,
    IVL_CF_STATE_CHECKS_FAILED,  ///< before flight: tumbled
    IVL_CF_STATE_CHECKS_PASSED,  ///< may be armed
    IVL_CF_STATE_ARMING,         ///< armed; brushed motors have nothing to wait for
    IVL_CF_STATE_READY,          ///< motors may run
    IVL_CF_STATE_FLYING,
    IVL_CF_STATE_LANDED,
    IVL_CF_STATE_RESET,
    IVL_CF_STATE_LEVEL_OUT,  ///< the set-point is old
    IVL_CF_STATE_EXCEPTION,
    IVL_CF_STATE_LOCKED,   ///< until a reboot
    IVL_CF_STATE_CRASHED,  ///< until it is recovered
    IVL_CF_STATE_COUNT
} ivl_cf_state_t;

/// Conditions, as bits.
enum
{
    IVL_CF_COND_ARMED = 1u << 0,
    IVL_CF_COND_FLYING = 1u << 1,
    IVL_CF_COND_TUMBLED = 1u << 2,
    IVL_CF_COND_SETPOINT_OLD = 1u << 3,   ///< 500 ms
    IVL_CF_COND_SETPOINT_DEAD = 1u << 4,  ///< 2 s
    IVL_CF_COND_ESTOP = 1u << 5,
    IVL_CF_COND_CRASHED = 1u << 6,
    IVL_CF_COND_PREFLIGHT_OVER = 1u << 7,
    IVL_CF_COND_LANDED_OVER = 1u << 8,
    IVL_CF_COND_COUNT = 9
};

/// What it looks at.
typedef struct
{
    uint32_t now_ms;
    float    acc_g[3];  ///< filtered specific force in B
    bool     motors_run;
    uint32_t setpoint_age_ms;
} ivl_cf_supervisor_in_t;

typedef struct
{
    // parameters
    uint8_t  auto_arm;
    uint8_t  stop;
    uint8_t  dump_info;
    uint16_t preflight_ms_max;
    uint16_t landed_ms_max;
    float    crash_g;  ///< a force that differs by more from 1 g is a crash; 0: no such check

    ivl_cf_state_t state;
    uint32_t       conditions;
    bool           armed, crashed, tumbled;
    float          force_g;  ///< norm of the filtered specific force
    bool           estop;
    bool           has_tumble, has_thrust, has_watchdog;
    uint32_t       t_tumble_ms, t_thrust_ms, t_watchdog_ms, t_ready_ms, t_landed_ms;
} ivl_cf_supervisor_t;

/// As after a reboot; parameters have their defaults.
void ivl_cf_supervisor_init(ivl_cf_supervisor_t *s);

/// In flight, armed, nothing remembered.
void ivl_cf_supervisor_fly(ivl_cf_supervisor_t *s, uint32_t now_ms);

/// One update.  @return true if the state has changed
bool ivl_cf_supervisor_update(ivl_cf_supervisor_t *s, const ivl_cf_supervisor_in_t *in);

/// The state that follows; the machine alone, for tests.
ivl_cf_state_t ivl_cf_supervisor_next(ivl_cf_state_t state, uint32_t conditions);

/// @return true if the wish is granted: to arm is refused in every state but CHECKS_PASSED
bool ivl_cf_supervisor_arm(ivl_cf_supervisor_t *s, bool arm);

/// @return false while tumbled
bool ivl_cf_supervisor_recover(ivl_cf_supervisor_t *s);
void ivl_cf_supervisor_watchdog(ivl_cf_supervisor_t *s, uint32_t now_ms);

bool ivl_cf_supervisor_motors_allowed(const ivl_cf_supervisor_t *s);

/// What clients are told, and what the high-level commander waits for.
bool ivl_cf_supervisor_can_fly(const ivl_cf_supervisor_t *s);
bool ivl_cf_supervisor_is_flying(const ivl_cf_supervisor_t *s);

/// Bits 0..7 of the info field; the planner's follow.
uint16_t ivl_cf_supervisor_bits(const ivl_cf_supervisor_t *s);

/// "Flying"; "?" for a number that is no state.
const char *ivl_cf_supervisor_name(ivl_cf_state_t state);

#endif  // IVL_CF_SUPERVISOR_H
