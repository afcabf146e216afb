/// @file world_replay.h
/// Recorded inputs through the flight core, tick by tick: no body, no sensors, no rotors.  The core runs where the model's does (sim_core.h).
#ifndef IVL_WORLD_REPLAY_H
#define IVL_WORLD_REPLAY_H

#include "sim_model.h"

/// What the core is told in one tick is its own ivl_in_t.  X(name, member of ivl_in_t, count, numpy_type, unit, doc)
// clang-format off
#define IVL_SIM_REPLAY_INPUTS(X) \
    X(t_us, t_us, 1, "u8", "us", "the tick's instant; rises from tick to tick") \
    X(t_pose_us, t_pose_us, 1, "u8", "us", "sampling instant of position and velocity, not after t_us") \
    X(p_WB_m, p_WB_m, 3, "f4", "m", "position of the body origin in W") \
    X(v_WB_mps, v_WB_mps, 3, "f4", "m/s", "its velocity in W") \
    X(q_WB, q_WB, 4, "f4", "1", "attitude, x y z w") \
    X(w_B_radps, w_B_radps, 3, "f4", "rad/s", "angular rate in B") \
    X(f_B_mps2, f_B_mps2, 3, "f4", "m/s^2", "specific force in B") \
    X(request, cmd.request, 1, "i4", "1", "of the operator: 0 idle, 1 hover, 2 approach, 3 abort") \
    X(p_hover_W_m, cmd.p_hover_W_m, 3, "f4", "m", "argument of hover") \
    X(speed_mps, cmd.speed_mps, 1, "f4", "m/s", "argument of approach") \
    X(angle_rad, cmd.angle_rad, 1, "f4", "rad", "argument of approach: above the horizontal, along +x") \
    X(vitals_given, vitals.given, 1, "u1", "1", "0: what follows about battery, radio and autopilot means nothing") \
    X(configured, vitals.configured, 1, "u1", "1", "the operator has put a configuration in force") \
    X(can_fly, vitals.can_fly, 1, "u1", "1", "the autopilot lets the motors run") \
    X(bypassed, vitals.bypassed, 1, "u1", "1", "somebody drives the motors past the core") \
    X(stock_idle, vitals.stock_idle, 1, "u1", "1", "the autopilot's own set-point asks for no thrust") \
    X(battery_V, vitals.vbat_V, 1, "f4", "V", "battery") \
    X(link_age_s, vitals.link_age_s, 1, "f4", "s", "since the link was last up") \
    X(setpoint_age_s, vitals.setpoint_age_s, 1, "f4", "s", "of the autopilot's own set-point") \
    X(host_age_s, vitals.host_age_s, 1, "f4", "s", "since the last command of the host") \
    X(p_sigma_m, vitals.p_sigma_m, 1, "f4", "m", "standard deviation of the position estimate") \
    X(rrev_t_us, rrev.t_us, 1, "u8", "us", "arrival of a camera's RREV; one that differs from the last is new") \
    X(rrev_per_s, rrev.value, 1, "f4", "1/s", "a camera's RREV") \
    X(rrev_valid, rrev.valid, 1, "u1", "1", "0: it has found nothing, or there is no camera") \
    X(range_t_us, range.t_us, 1, "u8", "us", "arrival of a ranging sensor's reading") \
    X(range_m, range.value, 1, "f4", "m", "a ranging sensor's distance along b_z") \
    X(range_valid, range.valid, 1, "u1", "1", "0: it has found nothing, or there is no ranging sensor") \
    X(flow_t_us, flow.t_us, 1, "u8", "us", "arrival of a flow sensor's reading") \
    X(flow_radps, flow.value, 1, "f4", "rad/s", "a flow sensor's OF_y") \
    X(flow_valid, flow.valid, 1, "u1", "1", "0: it has found nothing, or there is no flow sensor")

/// What the core answers in one tick.  X(c_type, name, numpy_type, unit, expression of its state `s` and output `o`, doc)
#define IVL_SIM_REPLAY_ROWS(X) \
    X(float, d_ceil_m, "f4", "m", o->ceiling.d_ceil_m, "distance to the ceiling, 0 if invalid") \
    X(float, d_sigma_m, "f4", "m", o->ceiling.d_sigma_m, "its standard deviation, 0 if invalid") \
    X(float, v_close_mps, "f4", "m/s", o->ceiling.v_close_mps, "closing speed, 0 if invalid") \
    X(float, rrev_per_s, "f4", "1/s", o->cues.rrev_per_s, "RREV, 0 if invalid") \
    X(float, of_y_radps, "f4", "rad/s", o->cues.of_y_radps, "ventral flow about body y, 0 if invalid") \
    X(float, age_s, "f4", "s", s->sense.age_s, "age of the sensed state in use") \
    X(float, thrust1_N, "f4", "N", o->thrust_N[0], "thrust command, front right") \
    X(float, thrust2_N, "f4", "N", o->thrust_N[1], "thrust command, rear right") \
    X(float, thrust3_N, "f4", "N", o->thrust_N[2], "thrust command, rear left") \
    X(float, thrust4_N, "f4", "N", o->thrust_N[3], "thrust command, front left") \
    X(float, thrust_total_N, "f4", "N", o->thrust_total_N, "their sum") \
    X(float, pitch_moment_Nm, "f4", "N m", o->pitch_moment_Nm, "moment about b_y of the thrust commands; nose-up is negative") \
    X(float, trigger_rrev_per_s, "f4", "1/s", s->snapshot.rrev_per_s, "RREV latched at the trigger, 0 before") \
    X(float, trigger_d_ceil_m, "f4", "m", s->snapshot.d_ceil_m, "distance latched at the trigger, 0 before") \
    X(uint32_t, n_bad_pose, "u4", "1", s->diag.n_bad_pose, "ticks so far whose sensed state was refused") \
    X(uint32_t, n_bad_command, "u4", "1", s->diag.n_bad_command, "ticks so far whose request was refused") \
    X(uint8_t, phase, "u1", "1", (uint8_t)o->phase, "after this tick's transitions, see ivl_phase_t") \
    X(uint8_t, rule, "u1", "1", s->guard.rule, "safety rule that holds now, see ivl_rule_t") \
    X(uint8_t, cause, "u1", "1", s->guard.cause, "safety rule that last ended a phase of this cycle") \
    X(uint8_t, cue_valid, "u1", "1", o->cues.valid ? 1u : 0u, "1 if the cues may be used") \
    X(uint8_t, triggered, "u1", "1", s->triggered ? 1u : 0u, "1 from the trigger on, 0 before") \
    X(uint8_t, motors_on, "u1", "1", o->motors_on ? 1u : 0u, "1 if the phase drives the motors in this tick")
// clang-format on

#define IVL_SIM_REPLAY_MEMBER(c_type, name, np, unit, expression, doc) c_type name;
typedef struct
{
    IVL_SIM_REPLAY_ROWS(IVL_SIM_REPLAY_MEMBER)
} ivl_sim_replay_row_t;
#undef IVL_SIM_REPLAY_MEMBER

typedef enum
{
    IVL_SIM_REPLAY_DONE,
    IVL_SIM_REPLAY_BAD_CONFIG,  ///< refused by the core
    IVL_SIM_REPLAY_BAD_POLICY   ///< refused by the core
} ivl_sim_replay_status_t;

/// Starts a core, commits a policy and steps it n times.  The result depends on the arguments alone.
/// @param[in] cfg     usually the model's own firmware with a few members changed
/// @param[out] rows   one a tick; all zero from the first on if something was refused
ivl_sim_replay_status_t ivl_sim_replay(const ivl_sim_model_t *model, const ivl_cfg_t *cfg, const ivl_policy_t *policy, const ivl_in_t *in,
                                       size_t n, ivl_sim_replay_row_t *rows);

#endif  // IVL_WORLD_REPLAY_H
