/// @file sdk_double.h
/// A stand-in for the Crazyflie SDK on the host: what the app asks is answered from sdk, what it does is written there.
/// Time stands still unless sdk_double_run lets it pass; vTaskDelay and a wait for packets let it pass too.
#ifndef SDK_DOUBLE_H
#define SDK_DOUBLE_H
#include <setjmp.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "cpx.h"
#include "log.h"
#include "mem.h"
#include "param.h"
#include "stabilizer_types.h"

#define SDK_SENT_MAX 64

typedef struct
{
    uint8_t bytes[30];
    size_t  size;
} sdk_packet_t;

typedef struct
{
    // asked by the app
    uint64_t     now_us;
    float        vbat_V;
    bool         can_fly;
    bool         is_connected;
    bool         high_level_is_stopped;
    bool         controller_runs;  ///< false: another controller is selected
    float        variance_m2;
    bool         has_variance;
    char         vague_axis;   ///< 'X', 'Y' or 'Z': the others have a variance of next to nothing; 0: all have the same
    float        range_up_mm;  ///< 0: no such sensor
    unsigned int motor_power_set;
    unsigned int idle_thrust;  ///< powerDist.idleThrust
    bool         has_no_idle;  ///< there is no such parameter
    bool         has_no_motor_power_set;
    setpoint_t   setpoint;
    sensorData_t sensors;
    state_t      state;
    float        pid_thrust;      ///< what the stock controller asks for, 0..65535
    sdk_packet_t incoming;        ///< size 0: none
    int          n_receive_left;  ///< calls of appchannelReceiveDataPacket until it jumps to `leave`
    jmp_buf      leave;

    // done by the app
    control_t                      control;
    stabilizerStep_t               step;
    int                            n_pid_init, n_pid_null, n_pid;
    stabilizerStep_t               last_pid_step, null_pid_step;
    int                            n_relax, n_go_to;
    int                            n_idle_told;
    int                            n_told;  ///< parameters that were changed by the app, and told to clients
    float                          go_to[5];
    char                           printed[80];  ///< format of the last line
    sdk_packet_t                   sent[SDK_SENT_MAX];
    int                            n_sent;
    cpxAppMessageHandlerCallback_t cpx_handler;  ///< stays when the double is reset, as the SDK's does
    const MemoryHandlerDef_t      *memory;
    int                            n_memory;
    void (*each_ms)(void);  ///< hook, called before each step of the stabilizer
} sdk_t;

extern sdk_t          sdk;
extern uint8_t        tumbleCheckEnabled;
extern struct param_s sdk_params_ivl[];
extern struct log_s   sdk_logs_ivl[];

/// A vehicle that hovers level at (0, 0, 1) m with all well; the stock controller selected by nobody.
void sdk_double_reset(void);

/// Let the stabilizer run for so many milliseconds, with a position that moves by nanometres so that it is seen to live.
void sdk_double_run(int ms);

/// Write a parameter as the radio does: bytes, then the callback.  Fails the test if there is none of that name.
void sdk_double_write_float(const char *name, float value);
void sdk_double_write_u32(const char *name, uint32_t value);

/// Read a parameter or a log variable of type float or smaller; fails the test if there is none of that name.
double sdk_double_read_param(const char *name);
double sdk_double_read_log(const char *name);
#endif  // SDK_DOUBLE_H
