/// @file ivl_vars.h
/// The one table of every parameter and every log variable of the core.
/// A parameter row is X(ctype, group, name, field, unit, min, max, default, doc): `field` is a member of ivl_cfg_t, which is itself made
/// from this table (ivl_cfg.h).  Numbers are plain decimal constants; users cast them to the type that they need.
/// group + name stay within 24 characters, name within 20, as the radio link demands.
/// Sources: [S] published simulation files of the inverted-landing study (2021); [P] its paper; others are choices of this project.
#ifndef IVL_VARS_H
#define IVL_VARS_H

// clang-format off
/// The vehicle and the place, as the core knows them: a simulator tells these from its own truth.
#define IVL_VEHICLE_PARAMS(X)                                                                                                                \
    /* vehicle [S] */                                                                                                                        \
    X(float, "ivl", "mass", mass_kg, "kg", 0.005, 0.5, 0.03584, "mass of body and legs")                                                     \
    X(float, "ivl", "jxx", jxx_kgm2, "kg m^2", 1.0e-6, 1.0e-2, 49.35e-6, "moment of inertia about b_x")                                      \
    X(float, "ivl", "jyy", jyy_kgm2, "kg m^2", 1.0e-6, 1.0e-2, 49.35e-6, "moment of inertia about b_y")                                      \
    X(float, "ivl", "jzz", jzz_kgm2, "kg m^2", 1.0e-6, 1.0e-2, 29.26e-6, "moment of inertia about b_z")                                      \
    X(float, "ivl", "gravity", gravity_mps2, "m/s^2", 1.0, 20.0, 9.81, "acceleration of gravity")                                            \
    X(float, "ivl", "arm_x", arm_x_m, "m", 0.005, 0.2, 0.033, "distance of each motor from the b_y axis")                                    \
    X(float, "ivl", "arm_y", arm_y_m, "m", 0.005, 0.2, 0.033, "distance of each motor from the b_x axis")                                    \
    X(float, "ivl", "torque_per_thrust", torque_per_thrust_m, "m", 1.0e-4, 0.1, 0.00612, "drag torque of a rotor per thrust")                \
    X(float, "ivl", "motor_thrust_max", motor_thrust_N_max, "N", 0.01, 5.0, 0.1615, "largest thrust of one motor")                           \
    X(float, "ivl", "motor_lag", motor_lag_s, "s", 0.0, 0.5, 0.0, "constant with which the thrust falls")                                    \
    X(float, "ivl", "vbat_rated", vbat_V_rated, "V", 0.0, 30.0, 3.7, "battery below this gives less than motor_thrust_max; 0: it always gives that")\
    X(float, "ivl", "d_touch", d_touch_m, "m", -0.2, 0.5, 0.02, "distance of the plane at which a level vehicle touches the ceiling")        \
    X(float, "ivl", "h_ceil", h_ceil_m, "m", -100.0, 100.0, 2.1, "height of the plane that the cues refer to, along the surface's normal")   \
    X(float, "ivl", "surface_tilt", surface_tilt_rad, "rad", 0.0, 3.1416, 0.0, "tilt of the surface's normal from up to W x: 0 ceiling, pi/2 wall ahead, pi floor")

/// How it flies.
#define IVL_FLIGHT_PARAMS(X)                                                                                                                 \
    X(float, "ivl", "tick_hz", tick_hz, "Hz", 100.0, 2000.0, 500.0, "rate at which ivl_step is called")                                      \
    /* ceiling and cues */                                                                                                                   \
    X(float, "ivl", "d_ceil_min", d_ceil_m_min, "m", 0.001, 1.0, 0.01, "smallest distance that gives a valid cue")                           \
    X(float, "ivl", "d_ceil_max", d_ceil_m_max, "m", 0.1, 100.0, 5.0, "largest distance that gives a valid cue")                             \
    /* sources of the distance: see ivl_distance.h */                                                                                        \
    X(uint8_t, "ivl", "d_source", d_source, "1", 0, 3, 0, "0 known height, 1 formula, 2 filter, 3 ranging sensor")                           \
    X(uint8_t, "ivl", "d_predict", d_predict, "1", 0, 1, 0, "known height: 1 carries the sample on to the present tick")                     \
    X(float, "ivl", "pose_latency", pose_latency_s, "s", 0.0, 0.2, 0.0, "known height: age of a position when it arrives, for d_predict")    \
    X(float, "ivl", "height_sigma", height_sigma_m, "m", 0.0, 1.0, 0.002, "known height: standard deviation of the distance")                \
    X(uint8_t, "ivl", "of_source", of_source, "1", 0, 1, 0, "OF_y from 0 velocity and distance, 1 the flow sensor")                          \
    X(float, "ivl", "d_sigma_max", d_sigma_norm_max, "1", 0.01, 10.0, 0.25, "a distance less certain than this part of itself is invalid")   \
    X(float, "ivl", "d_old_max", d_old_s_max, "s", 0.01, 1.0, 0.25, "a distance without a measurement for longer is invalid")                \
    X(float, "ivl", "rrev_delay", rrev_delay_s, "s", 0.0, 0.06, 0.0, "from the sampling instant of a measured RREV to its arrival")          \
    X(float, "ivl", "range_delay", range_delay_s, "s", 0.0, 0.12, 0.0, "the same of a range")                                                \
    X(float, "ivl", "accel_delay", accel_delay_s, "s", 0.0, 0.02, 0.0, "delay of the accelerometer's low-pass")                              \
    X(float, "ivl", "rrev_max", rrev_per_s_max, "1/s", 0.1, 100.0, 20.0, "a measured RREV beyond this is ignored")                           \
    X(float, "ivl", "rrev_sigma", rrev_sigma_per_s, "1/s", 0.001, 10.0, 0.05, "standard deviation of a measured RREV: constant part")        \
    X(float, "ivl", "rrev_sigma_norm", rrev_sigma_norm, "1", 0.0, 1.0, 0.05, "and part that grows with it")                                  \
    X(float, "ivl", "range_min", range_m_min, "m", 0.0, 1.0, 0.04, "a range below this is ignored [VL53L1x]")                                \
    X(float, "ivl", "range_max", range_m_max, "m", 0.1, 40.0, 4.0, "a range beyond this is ignored [VL53L1x]")                               \
    X(float, "ivl", "range_sigma", range_sigma_m, "m", 0.001, 1.0, 0.015, "range: what changes from one to the next, sigma [VL53L1x]")       \
    X(float, "ivl", "range_bias", range_bias_m, "m", 0.0, 1.0, 0.015, "range: what stays, and no filter averages out, sigma [VL53L1x]")      \
    X(float, "ivl", "rrev_tau", rrev_tau_s, "s", 0.0, 1.0, 0.04, "formula: lag of RREV, its derivative and the acceleration")                \
    X(float, "ivl", "accel_min", accel_mps2_min, "m/s^2", 0.0, 20.0, 0.5, "formula: invalid below this acceleration")                        \
    X(float, "ivl", "denom_min", denom_per_s2_min, "1/s^2", 0.001, 100.0, 0.5, "formula: invalid below this denominator")                    \
    X(float, "ivl", "kf_d_sigma", kf_d_sigma_m, "m", 0.001, 10.0, 0.5, "filter: standard deviation of the distance at the start")            \
    X(float, "ivl", "kf_v_sigma", kf_v_sigma_mps, "m/s", 0.001, 10.0, 0.05, "filter: of the closing speed at the start")                     \
    X(float, "ivl", "kf_b_sigma", kf_b_sigma_mps2, "m/s^2", 0.001, 10.0, 0.15, "filter: of the accelerometer's bias")                        \
    X(float, "ivl", "kf_q", kf_q_m2ps3, "m^2/s^3", 1.0e-6, 1.0, 5.0e-4, "filter: growth of the speed's variance in a second")                \
    X(float, "ivl", "kf_gate", kf_gate_norm, "1", 1.0, 100.0, 4.0, "filter: measurements further off than this many sigma are refused")      \
    X(float, "ivl", "flip_moment_max", flip_moment_Nm_max, "N m", 0.0, 0.02, 0.02, "largest moment that a policy may ask for")                     \
    /* tracking controller [S] */                                                                                                            \
    X(float, "ivl", "kp_pos_xy", kp_pos_xy_Npm, "N/m", 0.0, 100.0, 0.5, "position gain, horizontal")                                         \
    X(float, "ivl", "kp_pos_z", kp_pos_z_Npm, "N/m", 0.0, 100.0, 1.2, "position gain, vertical")                                             \
    X(float, "ivl", "kd_vel_xy", kd_vel_xy_Nspm, "N s/m", 0.0, 100.0, 0.4, "velocity gain, horizontal")                                      \
    X(float, "ivl", "kd_vel_z", kd_vel_z_Nspm, "N s/m", 0.0, 100.0, 0.35, "velocity gain, vertical")                                         \
    X(float, "ivl", "kp_att_xy", kp_att_xy_Nmprad, "N m/rad", 0.0, 1.0, 0.004, "attitude gain, roll and pitch")                              \
    X(float, "ivl", "kp_att_z", kp_att_z_Nmprad, "N m/rad", 0.0, 1.0, 0.003, "attitude gain, yaw")                                           \
    X(float, "ivl", "kd_rate_xy", kd_rate_xy_Nmsprad, "N m s/rad", 0.0, 1.0, 0.0017, "rate gain, roll and pitch")                            \
    X(float, "ivl", "kd_rate_z", kd_rate_z_Nmsprad, "N m s/rad", 0.0, 1.0, 0.001, "rate gain, yaw")                                          \
    X(float, "ivl", "tilt_cmd_max", tilt_cmd_rad_max, "rad", 0.1, 1.2, 0.8, "largest tilt that the controller asks for")                     \
    X(float, "ivl", "tilt_abort", tilt_abort_rad, "rad", 0.2, 1.5, 1.3, "ready, approach and level_out abort beyond this sensed tilt")       \
    /* approach [P] */                                                                                                                       \
    X(float, "ivl", "approach_accel", approach_accel_mps2, "m/s^2", 0.1, 20.0, 4.3, "acceleration along the approach path")                  \
    X(uint8_t, "ivl", "shape", shape, "1", 0, 3, 0, "approach: 0 accelerate and hold, 1 accelerate, 2 hold RREV for a while, 3 into the region")\
    X(float, "ivl", "shape_rrev", shape_rrev_per_s, "1/s", 0.1, 20.0, 3.0, "shape 2: RREV that is held")                                     \
    X(float, "ivl", "shape_speed", shape_speed_norm, "1", 0.05, 1.0, 0.6, "shape 2: part of the speed at which holding RREV ends")           \
    X(float, "ivl", "region_vx", region_vx_mps, "m/s", 0.0, 5.0, 1.2, "shape 3: at least this fast along the ceiling")                       \
    X(float, "ivl", "region_vz", region_vz_mps, "m/s", 0.0, 5.0, 2.0, "shape 3: at least this fast towards the ceiling")                     \
    X(float, "ivl", "region_rrev", region_rrev_per_s, "1/s", 0.5, 20.0, 4.0, "shape 3: that fast before RREV is this, a little less than a flip needs")\
    X(float, "ivl", "thrust_use", thrust_use_norm, "1", 0.05, 1.0, 0.8, "shape 3: part of the thrust beyond the weight that may be used to accelerate")\
    X(float, "ivl", "speed_min", speed_mps_min, "m/s", 0.01, 10.0, 0.1, "smallest approach speed that is accepted")                          \
    X(float, "ivl", "speed_max", speed_mps_max, "m/s", 0.1, 10.0, 6.0, "largest approach speed that is accepted")                            \
    /* phases */                                                                                                                             \
    X(float, "ivl", "ready_s_min", ready_s_min, "s", 0.0, 60.0, 0.0, "stay in ready before an approach may start")                           \
    X(float, "ivl", "stale_s_max", stale_s_max, "s", 0.002, 1.0, 0.1, "largest age of a sample that is still flown on")                      \
    X(float, "ivl", "approach_s_max", approach_s_max, "s", 0.1, 60.0, 10.0, "an approach without trigger aborts after this")                 \
    X(float, "ivl", "level_margin", level_margin_m, "m", 0.0, 1.0, 0.05, "clearance that a level-out is to leave")                           \
    X(float, "ivl", "level_out_s_max", level_out_s_max, "s", 0.1, 60.0, 10.0, "a level_out without a HOVER lands after this")               \
    X(float, "ivl", "flip_s_max", flip_s_max, "s", 0.01, 5.0, 1.0, "motors are cut this long after the trigger at the latest")               \
    X(float, "ivl", "coast_s_max", coast_s_max, "s", 0.1, 10.0, 2.5, "coast without contact ends after this")                                \
    X(float, "ivl", "attached_s", attached_s, "s", 0.0, 10.0, 1.0, "stay in attached before done")                                           \
    X(uint8_t, "ivl", "cut_at_inverted", cut_at_inverted, "1", 0, 1, 1, "cut motors half way round: at a ceiling when b_z passes the horizontal")                         \
    X(uint8_t, "ivl", "cut_on_contact", cut_on_contact, "1", 0, 1, 1, "cut motors at the first sensed contact")                              \
    X(float, "ivl", "contact_accel", contact_accel_mps2, "m/s^2", 12.0, 1000.0, 25.0, "specific force that means contact (a flip makes 10)") \
    X(float, "ivl", "hang_s", hang_s, "s", 0.02, 5.0, 0.2, "specific force reversed for this long means hanging")                            \
    /* rules: see ivl_guard.c */                                                                                                             \
    X(float, "ivl", "vbat_rest_min", vbat_V_rest_min, "V", 0.0, 30.0, 3.2, "battery below this refuses to arm")                              \
    X(float, "ivl", "vbat_min", vbat_V_min, "V", 0.0, 30.0, 2.7, "battery under load below this aborts")                                             \
    X(float, "ivl", "link_s_max", link_s_max, "s", 0.0, 10.0, 0.5, "link down for longer aborts")                                            \
    X(float, "ivl", "setpoint_s_max", setpoint_s_max, "s", 0.01, 0.45, 0.4, "set-point of the autopilot older than this aborts")             \
    X(float, "ivl", "host_s_max", host_s_max, "s", 0.05, 10.0, 0.5, "last command of the host older than this aborts")                       \
    X(float, "ivl", "p_sigma_max", p_sigma_m_max, "m", 0.001, 10.0, 0.1, "position less certain than this aborts")                           \
    X(float, "ivl", "speed_abort", speed_abort_mps, "m/s", 0.1, 50.0, 9.0, "sensed speed above this aborts")                                 \
    X(float, "ivl", "d_abort", d_abort_m, "m", 0.0, 1.0, 0.0, "an approach this close to the ceiling aborts")                                \
    X(float, "ivl", "fence_x_min", fence_x_m_min, "m", -200.0, 200.0, -100.0, "ready, approach and level_out abort outside this box in W")   \
    X(float, "ivl", "fence_x_max", fence_x_m_max, "m", -200.0, 200.0, 100.0, "same box")                                                     \
    X(float, "ivl", "fence_y_min", fence_y_m_min, "m", -200.0, 200.0, -100.0, "same box")                                                    \
    X(float, "ivl", "fence_y_max", fence_y_m_max, "m", -200.0, 200.0, 100.0, "same box")                                                     \
    X(float, "ivl", "fence_z_min", fence_z_m_min, "m", -200.0, 200.0, -100.0, "same box")                                                    \
    X(float, "ivl", "fence_z_max", fence_z_m_max, "m", -200.0, 200.0, 100.0, "same box")                                                     \
    /* after an abort, and changes of the controller */                                                                                      \
    X(float, "ivl", "abort_hover_s", abort_hover_s, "s", 0.0, 60.0, 2.0, "hover after an abort before landing")                              \
    X(float, "ivl", "land_speed", land_speed_mps, "m/s", 0.05, 2.0, 0.3, "speed of the descent after an abort")                              \
    X(float, "ivl", "land_height", land_height_m, "m", -100.0, 100.0, 0.05, "height in W at which the landing is over")                      \
    X(float, "ivl", "rearm_s", rearm_s, "s", 0.0, 60.0, 1.0, "rest upright before another controller gets the motors back")                  \
    X(float, "ivl", "handover_s", handover_s, "s", 0.0, 2.0, 0.3, "a step of thrust between two controllers fades in this")                  \
    /* thrust curve [S]: PWM = a tan((f - b) / c) + d, f in gram-force */                                                                    \
    X(float, "ivl", "pwm_a", pwm_a, "1", 1.0, 1.0e6, 33100.0, "scale of the thrust curve")                                                   \
    X(float, "ivl", "pwm_b", pwm_b_gf, "gf", -100.0, 100.0, 8.72, "thrust at the middle of the thrust curve")                                \
    X(float, "ivl", "pwm_c", pwm_c_gf, "gf", 0.1, 1000.0, 11.2, "width of the thrust curve")                                                 \
    X(float, "ivl", "pwm_d", pwm_d, "1", -1.0e6, 1.0e6, 32600.0, "PWM at the middle of the thrust curve")                                    \
    X(float, "ivl", "pwm_max", pwm_max, "1", 1.0, 65535.0, 60000.0, "largest PWM value")

#define IVL_PARAMS(X) IVL_VEHICLE_PARAMS(X) IVL_FLIGHT_PARAMS(X)

/// A log row is X(ctype, group, name, struct, field, unit, doc): `field` is a member path for offsetof(struct, field).
#define IVL_LOGS(X)                                                                                                      \
    X(uint8_t, "ivl", "phase", ivl_out_t, phase_log, "1", "phase number, see ivl_phase_t")                               \
    X(uint8_t, "ivl", "motors_on", ivl_out_t, motors_on, "1", "1 while any motor may run")                               \
    X(uint8_t, "ivl", "stock_allowed", ivl_out_t, stock_allowed, "1", "1 while another controller may have the motors")  \
    X(uint8_t, "ivl", "rule", ivl_state_t, guard.rule, "1", "safety rule that holds now, see ivl_rule_t")                \
    X(uint8_t, "ivl", "cause", ivl_state_t, guard.cause, "1", "safety rule that last ended a phase of this cycle")       \
    X(float, "ivl", "thrust1", ivl_out_t, thrust_N[0], "N", "thrust command, front right")                               \
    X(float, "ivl", "thrust2", ivl_out_t, thrust_N[1], "N", "thrust command, rear right")                                \
    X(float, "ivl", "thrust3", ivl_out_t, thrust_N[2], "N", "thrust command, rear left")                                 \
    X(float, "ivl", "thrust4", ivl_out_t, thrust_N[3], "N", "thrust command, front left")                                \
    X(uint16_t, "ivl", "pwm1", ivl_out_t, pwm[0], "1", "PWM command, front right")                                       \
    X(uint16_t, "ivl", "pwm2", ivl_out_t, pwm[1], "1", "PWM command, rear right")                                        \
    X(uint16_t, "ivl", "pwm3", ivl_out_t, pwm[2], "1", "PWM command, rear left")                                         \
    X(uint16_t, "ivl", "pwm4", ivl_out_t, pwm[3], "1", "PWM command, front left")                                        \
    X(float, "ivl", "thrust_total", ivl_out_t, thrust_total_N, "N", "sum of the thrust commands")                        \
    X(float, "ivl", "pitch_moment", ivl_out_t, pitch_moment_Nm, "N m", "moment about b_y of the thrust commands")        \
    X(float, "ivl", "d_ceil", ivl_out_t, ceiling.d_ceil_m, "m", "distance to the ceiling, 0 if invalid")                 \
    X(float, "ivl", "d_age", ivl_out_t, ceiling.age_s, "s", "age of the distance")                                       \
    X(float, "ivl", "d_sigma", ivl_out_t, ceiling.d_sigma_m, "m", "standard deviation of the distance, 0 if invalid")    \
    X(float, "ivl", "v_close", ivl_out_t, ceiling.v_close_mps, "m/s", "closing speed, 0 if invalid")                     \
    X(float, "ivl", "rrev", ivl_out_t, cues.rrev_per_s, "1/s", "RREV, 0 if invalid")                                     \
    X(float, "ivl", "of_y", ivl_out_t, cues.of_y_radps, "rad/s", "ventral flow about body y, 0 if invalid")              \
    X(float, "ivl", "age", ivl_state_t, sense.age_s, "s", "age of the sample in use")                                    \
    X(float, "ivl", "kf_bias", ivl_state_t, distance.filter.b_mps2, "m/s^2", "filter: bias of the accelerometer")        \
    X(uint32_t, "ivl", "n_measured", ivl_state_t, distance.n_taken, "1", "measurements of this approach that were taken")\
    X(uint32_t, "ivl", "n_gated", ivl_state_t, distance.n_gated, "1", "measurements of this approach that were refused as too far off")\
    X(uint32_t, "ivl", "policy_seq", ivl_state_t, policy.id.seq, "1", "number of the policy in use")                     \
    X(uint32_t, "ivl", "policy_crc", ivl_state_t, policy.id.crc, "1", "its checksum")                                    \
    X(uint8_t, "ivl", "policy_form", ivl_state_t, policy.id.form, "1", "its form")                                       \
    X(float, "ivl", "theta0", ivl_state_t, policy.theta[0], "SI", "its first parameter")                                 \
    X(float, "ivl", "theta1", ivl_state_t, policy.theta[1], "SI", "its second parameter")                                \
    X(float, "ivl", "theta2", ivl_state_t, policy.theta[2], "SI", "its third parameter, 0 if it has none")               \
    X(float, "ivl", "theta3", ivl_state_t, policy.theta[3], "SI", "its fourth parameter, 0 if it has none")              \
    X(uint8_t, "ivl", "go", ivl_state_t, action.go, "1", "0 if the policy finds a landing too improbable")             \
    X(float, "ivl", "flip_moment", ivl_state_t, action.moment_Nm, "N m", "moment that the policy asks for")              \
    X(float, "ivl", "p_land", ivl_state_t, action.p_land, "1", "probability of a landing that the policy estimates, 1 if it does not")\
    X(float, "ivl", "p_decided", ivl_state_t, decision.p_land, "1", "that probability when go or no-go was decided last, 0 before, or if there was no cue")\
    X(float, "ivl", "d_decided", ivl_state_t, decision.d_ceil_m, "m", "distance at which go or no-go was decided last, 0 before, or if there was no cue")\
    X(uint8_t, "ivl", "decided", ivl_state_t, decision.made, "1", "1 once go or no-go was decided in this approach")       \
    X(float, "ivl", "aim_vx", ivl_state_t, approach.aim.vx_mps, "m/s", "velocity along W x that the approach aims at, 0 before")\
    X(float, "ivl", "aim_vz", ivl_state_t, approach.aim.vz_mps, "m/s", "velocity along W z that the approach aims at, 0 before")\
    X(float, "ivl", "trg_d", ivl_state_t, snapshot.d_ceil_m, "m", "distance at the trigger")                             \
    X(float, "ivl", "trg_d_sigma", ivl_state_t, snapshot.d_sigma_m, "m", "standard deviation of the distance at the trigger")\
    X(float, "ivl", "trg_rrev", ivl_state_t, snapshot.rrev_per_s, "1/s", "RREV at the trigger")                          \
    X(float, "ivl", "trg_of_y", ivl_state_t, snapshot.of_y_radps, "rad/s", "ventral flow at the trigger")                \
    X(float, "ivl", "trg_vx", ivl_state_t, snapshot.sample.v_WB_mps.x, "m/s", "velocity along W x at the trigger")       \
    X(float, "ivl", "trg_vz", ivl_state_t, snapshot.sample.v_WB_mps.z, "m/s", "velocity along W z at the trigger")       \
    X(float, "ivl", "trg_moment", ivl_state_t, snapshot.action.moment_Nm, "N m", "moment of the flip")                   \
    X(uint32_t, "ivl", "trg_seq", ivl_state_t, snapshot.policy.seq, "1", "number of the policy that triggered")          \
    X(uint32_t, "ivl", "trg_crc", ivl_state_t, snapshot.policy.crc, "1", "its checksum")                                 \
    X(uint32_t, "ivl", "n_tick", ivl_state_t, diag.n_tick, "1", "ticks since ivl_init")                                  \
    X(uint32_t, "ivl", "n_bad_pose", ivl_state_t, diag.n_bad_pose, "1", "ticks with an unusable sensed state")           \
    X(uint32_t, "ivl", "n_bad_cmd", ivl_state_t, diag.n_bad_command, "1", "ticks with an unusable command")              \
    X(uint32_t, "ivl", "n_refused", ivl_state_t, diag.n_policy_refused, "1", "policies refused")                         \
    X(uint32_t, "ivl", "n_abort", ivl_state_t, diag.n_abort, "1", "entries into aborted")                                \
    X(uint32_t, "ivl", "n_trigger", ivl_state_t, diag.n_trigger, "1", "triggers fired")                                  \
    X(uint32_t, "ivl", "n_no_go", ivl_state_t, diag.n_no_go, "1", "approaches called off: no-go, or no cue at the last moment")
// clang-format on
#endif  // IVL_VARS_H
