/// @file app_port.h
/// What a program that simulates the vehicle may ask of the app, beside the hooks that the SDK itself calls (controller.h, app.h).  The app's
/// memory is its own.  One thread, which is all of the SDK's tasks.
#ifndef APP_PORT_H
#define APP_PORT_H
#include "ivl.h"

/// Power-on: the memory is empty, and this configuration is the one that was flashed.  Before controllerOutOfTreeInit, which else
/// starts from the platform's defaults.
void app_boot(const ivl_cfg_t *cfg);

/// The vehicle was put elsewhere, as only a simulated one can be: core, senses and hand-over begin anew.  Policy, command, counters and the
/// owner of the motors stay.
void app_begin_anew(void);

/// Whether an approach puts the vehicle on its path, as only a simulated one can be put: then it may be asked for without READY before it.
/// A policy that flips at once belongs to such a landing: it does so no longer when the vehicle flies by itself.
void app_start_on_path(bool yes);

/// The stock controller has the motors, and nobody has asked for anything else.
/// @param[in] mean_norm  mean thrust with which it flies, as a share of the largest
void app_release(float mean_norm);

/// Put a policy in force, as one that a packet brings.
ivl_status_t app_policy_apply(const ivl_policy_t *policy);

/// A camera on board says something; each reading counts if it was sampled after the one before.
void app_camera_says(const ivl_reading_t *rrev, const ivl_reading_t *flow);

/// The core's state and output after its last tick, and the command that it follows.  Valid for ever; the values change with each tick.
const ivl_state_t   *app_core_state(void);
const ivl_out_t     *app_core_out(void);
const ivl_command_t *app_command(void);

/// Asked of the program: true if its stabilizer can run the core at this rate.
bool app_has_rate(float tick_hz);

// ---- the app's task, for a program without tasks: appMain is app_task_start, then app_task_once for ever

void app_task_start(void);

/// Wait for a packet, for a few milliseconds at most, and do what is to be done.
void app_task_once(void);

/// True while the task has to come back within a millisecond: the stabilizer's task has yet to take what a packet asked for.
bool app_task_is_pressed(void);
#endif  // APP_PORT_H
