/// @file cf_names.h
/// Parameters and log variables of the stock firmware that the simulated vehicle serves: the one list, from which the tables of both are made
/// and the page docs/SIL_TABLES.md is written.  Names, types, access and first values are those of firmware 2026.08.
///
///   LIVE  the simulation changes it or obeys it
///   HELD  it is there because every Crazyflie has it: it keeps what is written to it, or stays at its first value, and changes no flight
///
/// Not here: what the app brings (ivl.*), what the server adds (fault.*, the time), and the drivers of decks that cannot be attached.
#ifndef IVL_CF_NAMES_H
#define IVL_CF_NAMES_H

// access: C core, that is documented and kept from release to release; P persistent; R read-only; N nothing of these

// clang-format off

// ---- LIVE(type, group, name, access, where, what follows from a write)   HELD(type, group, name, access, first value)
#define IVL_CF_PARAMS(LIVE, HELD) \
    LIVE(U8,  sil, reset,       N, THE.set.sim.reset, reset_written) \
    LIVE(U8,  sil, place,       N, THE.set.sim.place, place_written) \
    LIVE(U8,  sil, start,       N, THE.set.sim.start, start_written) \
    LIVE(U32, sil, seed_lo,     N, THE.set.sim.seed_lo, NULL) \
    LIVE(U32, sil, seed_hi,     N, THE.set.sim.seed_hi, NULL) \
    LIVE(U32, sil, stream_lo,   N, THE.set.sim.stream_lo, NULL) \
    LIVE(U32, sil, stream_hi,   N, THE.set.sim.stream_hi, NULL) \
    LIVE(F64, sil, d_ceil,      N, THE.set.sim.d_ceil_m, numbers_written) \
    LIVE(F64, sil, speed,       N, THE.set.sim.speed_mps, numbers_written) \
    LIVE(F64, sil, angle,       N, THE.set.sim.angle_deg, numbers_written) \
    LIVE(F32, sil, start_x,     N, THE.set.sim.start_x_m, numbers_written) \
    LIVE(F32, sil, start_y,     N, THE.set.sim.start_y_m, numbers_written) \
    LIVE(F32, sil, start_z,     N, THE.set.sim.start_z_m, numbers_written) \
    LIVE(F32, sil, wall_x,      N, THE.set.sim.wall_x_m, numbers_written) \
    LIVE(F32, sil, wall_y,      N, THE.set.sim.wall_y_m, numbers_written) \
    LIVE(F32, sil, vbat,        N, THE.set.sim.vbat_V, numbers_written) \
    LIVE(F32, sil, cell,        N, THE.set.sim.cell_V, numbers_written) \
    LIVE(U8,  sil, pose_source, N, THE.set.sim.pose_source, estimation_written) \
    LIVE(U8,  sil, auto_arm,    N, THE.supervisor.auto_arm, NULL) \
    \
    LIVE(U8,  stabilizer, estimator,  C, THE.set.estimator, NULL) \
    LIVE(U8,  stabilizer, controller, C, THE.set.controller, controller_written) \
    LIVE(U8,  stabilizer, stop,       C, THE.supervisor.stop, NULL) \
    LIVE(U8,  supervisor, tmblChckEn,    P, tumbleCheckEnabled, NULL) \
    LIVE(U8,  supervisor, infdmp,        N, THE.supervisor.dump_info, info_written) \
    LIVE(U16, supervisor, prefltTimeout, P, THE.supervisor.preflight_ms_max, NULL) \
    LIVE(U16, supervisor, landedTimeout, P, THE.supervisor.landed_ms_max, NULL) \
    HELD(U16, supervisor, spinupTimeout, P, 2000) \
    LIVE(F32, supervisor, crashDetectGs, P, THE.supervisor.crash_g, NULL) \
    LIVE(U8,  commander, enHighLevel, C, THE.set.high_level, NULL) \
    LIVE(F32, hlCommander, vtoff,     C, THE.set.takeoff_mps, numbers_written) \
    LIVE(F32, hlCommander, vland,     C, THE.set.landing_mps, numbers_written) \
    LIVE(U8,  hlCommander, groupmask, C, THE.set.group_mask, NULL) \
    LIVE(U8,  flightmode, althold,       C, THE.set.alt_hold, NULL) \
    LIVE(U8,  flightmode, poshold,       C, THE.set.pos_hold, NULL) \
    LIVE(U8,  flightmode, posSet,        C, THE.set.pos_set, NULL) \
    LIVE(U8,  flightmode, yawMode,       N, THE.set.yaw_mode, NULL) \
    LIVE(U8,  flightmode, stabModeRoll,  C, THE.set.stab_roll, NULL) \
    LIVE(U8,  flightmode, stabModePitch, C, THE.set.stab_pitch, NULL) \
    LIVE(U8,  flightmode, stabModeYaw,   C, THE.set.stab_yaw, NULL) \
    LIVE(F32, cppm, rateRoll,  P, THE.set.cppm.roll_degps, NULL) \
    LIVE(F32, cppm, ratePitch, P, THE.set.cppm.pitch_degps, NULL) \
    LIVE(F32, cppm, rateYaw,   P, THE.set.cppm.yaw_degps, NULL) \
    LIVE(F32, cppm, angPitch,  P, THE.set.cppm.pitch_deg, NULL) \
    LIVE(F32, cppm, angRoll,   P, THE.set.cppm.roll_deg, NULL) \
    LIVE(U32, powerDist, idleThrust, CP, THE.set.idle_pwm, NULL) \
    LIVE(U8,  motorPowerSet, enable, C, THE.set.bypass, NULL) \
    LIVE(U16, motorPowerSet, m1,     C, THE.set.bypass_pwm[0], NULL) \
    LIVE(U16, motorPowerSet, m2,     C, THE.set.bypass_pwm[1], NULL) \
    LIVE(U16, motorPowerSet, m3,     C, THE.set.bypass_pwm[2], NULL) \
    LIVE(U16, motorPowerSet, m4,     C, THE.set.bypass_pwm[3], NULL) \
    LIVE(U8,  kalman, resetEstimation, C, THE.set.reset_estimation, estimation_written) \
    LIVE(F32, kalman, initialX,   C, THE.set.initial_m[0], NULL) \
    LIVE(F32, kalman, initialY,   C, THE.set.initial_m[1], NULL) \
    LIVE(F32, kalman, initialZ,   C, THE.set.initial_m[2], NULL) \
    LIVE(F32, kalman, initialYaw, C, THE.set.initial_yaw_rad, NULL) \
    LIVE(F32, locSrv, extPosStdDev,    C, THE.set.ext_pos_sigma_m, NULL) \
    HELD(F32, locSrv, extQuatStdDev,   C, 4.5e-3f) \
    LIVE(U8,  memTst, resetW,   N, THE.set.tester_reset, NULL) \
    LIVE(U8,  health, startPropTest, C, THE.set.prop_test, health_written) \
    LIVE(U8,  health, startBatTest,  C, THE.set.battery_test, health_written) \
    LIVE(U8,  system, taskDump,      C, THE.set.task_dump, system_written) \
    LIVE(U8,  system, assertInfo,    N, THE.set.assert_info, system_written) \
    LIVE(U8,  system, storageStats,  N, THE.set.storage_stats, system_written) \
    LIVE(I8,  system, selftestPassed, CR, THE.set.selftest_passed, NULL) \
    LIVE(U8,  deck, bcFlow2,       CR, THE.set.has_flow_deck, NULL) \
    LIVE(U8,  deck, bcMultiranger, CR, THE.set.has_ranger_deck, NULL) \
    \
    LIVE(F32, pm, lowVoltage,         CP, THE.set.low_V, NULL) \
    HELD(F32, pm, criticalLowVoltage, CP, 3.0f) \
    HELD(U8,  kalman, robustTdoa, C, 0) \
    HELD(U8,  kalman, robustTwr,  C, 0) \
    HELD(F32, kalman, pNAcc_xy, CP, 0.5f) \
    HELD(F32, kalman, pNAcc_z,  CP, 1.0f) \
    HELD(F32, kalman, pNVel,    CP, 0.0f) \
    HELD(F32, kalman, pNPos,    CP, 0.0f) \
    HELD(F32, kalman, pNAtt,    CP, 0.0f) \
    HELD(F32, kalman, mNBaro,   CP, 2.0f) \
    HELD(F32, kalman, mNGyro_rollpitch, CP, 0.1f) \
    HELD(F32, kalman, mNGyro_yaw,       CP, 0.1f) \
    HELD(F32, kalman, dragB_x, CP, 0.0f) \
    HELD(F32, kalman, dragB_y, CP, 0.0f) \
    HELD(F32, kalman, dragB_z, CP, 0.0f) \
    HELD(F32, kalman, cop_x,   CP, 0.0f) \
    HELD(F32, kalman, cop_y,   CP, 0.0f) \
    HELD(F32, kalman, cop_z,   CP, 0.0f) \
    HELD(F32, kalman, maxPos,  C, 100.0f) \
    HELD(F32, kalman, maxVel,  C, 10.0f) \
    HELD(F32, posEstAlt, estAlphaAsl,  CP, 0.9f) \
    HELD(F32, posEstAlt, estAlphaZr,   CP, 0.9f) \
    HELD(F32, posEstAlt, vAccDeadband, CP, 0.04f) \
    HELD(F32, posEstAlt, velFactor,    P, 1.0f) \
    HELD(F32, posEstAlt, velZAlpha,    P, 0.995f) \
    HELD(F32, sensfusion6, kp,       CP, 0.8f) \
    HELD(F32, sensfusion6, ki,       CP, 0.002f) \
    HELD(F32, sensfusion6, baseZacc, N, 1.0f) \
    HELD(F32, pid_attitude, roll_kp,   P, 6.0f) \
    HELD(F32, pid_attitude, roll_ki,   P, 3.0f) \
    HELD(F32, pid_attitude, roll_kd,   P, 0.0f) \
    HELD(F32, pid_attitude, roll_kff,  P, 0.0f) \
    HELD(F32, pid_attitude, pitch_kp,  P, 6.0f) \
    HELD(F32, pid_attitude, pitch_ki,  P, 3.0f) \
    HELD(F32, pid_attitude, pitch_kd,  P, 0.0f) \
    HELD(F32, pid_attitude, pitch_kff, P, 0.0f) \
    HELD(F32, pid_attitude, yaw_kp,    P, 6.0f) \
    HELD(F32, pid_attitude, yaw_ki,    P, 1.0f) \
    HELD(F32, pid_attitude, yaw_kd,    P, 0.35f) \
    HELD(F32, pid_attitude, yaw_kff,   P, 0.0f) \
    HELD(F32, pid_attitude, yawMaxDelta, P, 0.0f) \
    HELD(I8,  pid_attitude, attFiltEn,   P, 0) \
    HELD(F32, pid_attitude, attFiltCut,  P, 15.0f) \
    HELD(F32, pid_rate, roll_kp,   P, 250.0f) \
    HELD(F32, pid_rate, roll_ki,   P, 500.0f) \
    HELD(F32, pid_rate, roll_kd,   P, 2.5f) \
    HELD(F32, pid_rate, roll_kff,  P, 0.0f) \
    HELD(F32, pid_rate, pitch_kp,  P, 250.0f) \
    HELD(F32, pid_rate, pitch_ki,  P, 500.0f) \
    HELD(F32, pid_rate, pitch_kd,  P, 2.5f) \
    HELD(F32, pid_rate, pitch_kff, P, 0.0f) \
    HELD(F32, pid_rate, yaw_kp,    P, 120.0f) \
    HELD(F32, pid_rate, yaw_ki,    P, 16.7f) \
    HELD(F32, pid_rate, yaw_kd,    P, 0.0f) \
    HELD(F32, pid_rate, yaw_kff,   P, 0.0f) \
    HELD(I8,  pid_rate, rateFiltEn, P, 0) \
    HELD(F32, pid_rate, omxFiltCut, P, 30.0f) \
    HELD(F32, pid_rate, omyFiltCut, P, 30.0f) \
    HELD(F32, pid_rate, omzFiltCut, P, 30.0f) \
    HELD(F32, velCtlPid, vxKp,  P, 25.0f) \
    HELD(F32, velCtlPid, vxKi,  P, 1.0f) \
    HELD(F32, velCtlPid, vxKd,  P, 0.0f) \
    HELD(F32, velCtlPid, vxKFF, P, 0.0f) \
    HELD(F32, velCtlPid, vyKp,  P, 25.0f) \
    HELD(F32, velCtlPid, vyKi,  P, 1.0f) \
    HELD(F32, velCtlPid, vyKd,  P, 0.0f) \
    HELD(F32, velCtlPid, vyKFF, P, 0.0f) \
    HELD(F32, velCtlPid, vzKp,  P, 25.0f) \
    HELD(F32, velCtlPid, vzKi,  P, 15.0f) \
    HELD(F32, velCtlPid, vzKd,  P, 0.0f) \
    HELD(F32, velCtlPid, vzKFF, P, 0.0f) \
    HELD(F32, posCtlPid, xKp,  P, 2.0f) \
    HELD(F32, posCtlPid, xKi,  P, 0.0f) \
    HELD(F32, posCtlPid, xKd,  P, 0.0f) \
    HELD(F32, posCtlPid, xKff, P, 0.0f) \
    HELD(F32, posCtlPid, yKp,  P, 2.0f) \
    HELD(F32, posCtlPid, yKi,  P, 0.0f) \
    HELD(F32, posCtlPid, yKd,  P, 0.0f) \
    HELD(F32, posCtlPid, yKff, P, 0.0f) \
    HELD(F32, posCtlPid, zKp,  P, 2.0f) \
    HELD(F32, posCtlPid, zKi,  P, 0.5f) \
    HELD(F32, posCtlPid, zKd,  P, 0.0f) \
    HELD(F32, posCtlPid, zKff, P, 0.0f) \
    HELD(U16, posCtlPid, thrustBase, P, 36000) \
    HELD(U16, posCtlPid, thrustMin,  P, 20000) \
    HELD(F32, posCtlPid, rLimit,  P, 20.0f) \
    HELD(F32, posCtlPid, pLimit,  P, 20.0f) \
    HELD(F32, posCtlPid, xVelMax, P, 1.0f) \
    HELD(F32, posCtlPid, yVelMax, P, 1.0f) \
    HELD(F32, posCtlPid, zVelMax, P, 1.0f) \
    HELD(F32, ctrlMel, kp_xy, CP, 0.4f) \
    HELD(F32, ctrlMel, kd_xy, CP, 0.2f) \
    HELD(F32, ctrlMel, ki_xy, CP, 0.05f) \
    HELD(F32, ctrlMel, i_range_xy, P, 2.0f) \
    HELD(F32, ctrlMel, kp_z, CP, 1.25f) \
    HELD(F32, ctrlMel, kd_z, CP, 0.4f) \
    HELD(F32, ctrlMel, ki_z, CP, 0.05f) \
    HELD(F32, ctrlMel, i_range_z, P, 0.4f) \
    HELD(F32, ctrlMel, mass,       CP, 0.0325f) \
    HELD(F32, ctrlMel, massThrust, CP, 132000.0f) \
    HELD(F32, ctrlMel, kR_xy, CP, 70000.0f) \
    HELD(F32, ctrlMel, kR_z,  CP, 60000.0f) \
    HELD(F32, ctrlMel, kw_xy, CP, 20000.0f) \
    HELD(F32, ctrlMel, kw_z,  CP, 12000.0f) \
    HELD(F32, ctrlMel, ki_m_xy, CP, 0.0f) \
    HELD(F32, ctrlMel, ki_m_z,  CP, 500.0f) \
    HELD(F32, ctrlMel, kd_omega_rp,  CP, 200.0f) \
    HELD(F32, ctrlMel, i_range_m_xy, P, 1.0f) \
    HELD(F32, ctrlMel, i_range_m_z,  P, 1500.0f) \
    HELD(U8,  colAv, enable,     C, 0) \
    HELD(F32, colAv, ellipsoidX, C, 0.3f) \
    HELD(F32, colAv, ellipsoidY, C, 0.3f) \
    HELD(F32, colAv, ellipsoidZ, C, 0.9f) \
    HELD(F32, colAv, horizon,    N, 1.0f) \
    HELD(F32, colAv, maxSpeed,   N, 0.5f) \
    HELD(F32, colAv, sidestepThrsh, N, 0.25f) \
    HELD(I32, colAv, maxPeerLocAge, N, 5000) \
    HELD(U8,  locSrv, enRangeStreamFP32, C, 0) \
    HELD(U8,  locSrv, enLhAngleStream,   C, 0) \
    HELD(U8,  locSrv, enLhMtchStm,       C, 0) \
    HELD(U8,  locSrv, maxTimeLhMtchStm,  C, 25) \
    HELD(U8,  locSrv, minBsLhMtchStm,    C, 2) \
    HELD(U8,  lighthouse, method,       C, 1) \
    HELD(U8,  lighthouse, bsCalibReset, C, 0) \
    HELD(U8,  lighthouse, systemType,   C, 2) \
    HELD(U16, lighthouse, bsAvailable,  CR, 0) \
    HELD(F32, lighthouse, sweepStd,     C, 0.0004f) \
    HELD(F32, lighthouse, sweepStd2,    C, 0.001f) \
    HELD(U8,  lighthouse, fwdToEstimator, C, 1) \
    HELD(U8,  tdoaEngine, logId,     C, 0) \
    HELD(U8,  tdoaEngine, logOthrId, C, 0) \
    HELD(F32, health, propTestThreshold,  CP, 0.0f) \
    HELD(F32, health, propTestThresholdL, CP, 0.01f) \
    HELD(U16, health, propTestPWMRatio,   CP, 0) \
    HELD(U16, health, batTestPWMRatio,    CP, 0) \
    HELD(F32, flowdeck, flowdeckPos_x, CP, 0.0f) \
    HELD(F32, flowdeck, flowdeckPos_y, CP, 0.0f) \
    HELD(F32, flowdeck, flowdeckPos_z, CP, 0.0f) \
    HELD(F32, motion, flowStdFixed, CP, 2.0f) \
    HELD(U8,  motion, disable,  N, 0) \
    HELD(U8,  motion, adaptive, N, 0) \
    HELD(U16, multiranger, filterMask, N, 1) \
    HELD(F32, imu_sensors, imuPhi,   P, 0.0f) \
    HELD(F32, imu_sensors, imuTheta, P, 0.0f) \
    HELD(F32, imu_sensors, imuPsi,   P, 0.0f) \
    HELD(U8,  imu_sensors, BMP3XX,   R, 0) \
    HELD(U8,  led, bitmask, N, 0) \
    HELD(U8,  sound, effect,   CP, 0) \
    HELD(U32, sound, neffect,  CR, 14) \
    HELD(U16, sound, freq,     C, 4000) \
    HELD(U8,  ring, effect,          CP, 6) \
    HELD(U32, ring, neffect,         CR, 18) \
    HELD(U8,  ring, solidRed,        C, 20) \
    HELD(U8,  ring, solidGreen,      C, 20) \
    HELD(U8,  ring, solidBlue,       C, 20) \
    HELD(U8,  ring, headlightEnable, C, 0) \
    HELD(F32, ring, emptyCharge,     C, 3.1f) \
    HELD(F32, ring, fullCharge,      C, 4.2f) \
    HELD(U32, ring, fadeColor,       C, 0) \
    HELD(F32, ring, fadeTime,        C, 0.5f) \
    HELD(U8,  system, highlight,       C, 0) \
    HELD(U8,  system, testLogParam,    N, 0) \
    HELD(U16, cpu, flash, CR, 1024) \
    LIVE(U32, cpu, id0, CR, THE.set.cpu_id[0], NULL) \
    LIVE(U32, cpu, id1, CR, THE.set.cpu_id[1], NULL) \
    LIVE(U32, cpu, id2, CR, THE.set.cpu_id[2], NULL) \
    HELD(U32, firmware, revision0, CR, 0) \
    HELD(U16, firmware, revision1, CR, 0) \
    HELD(U8,  firmware, modified,  CR, 0) \
    HELD(U16, crtpsrv, echoDelay, N, 0) \
    HELD(U8,  syslink, probe, N, 0) \
    HELD(U8,  usec, reset, N, 0) \
    HELD(U8,  deck, bcActiveMarker, CR, 0) \
    HELD(U8,  deck, bcAI,           CR, 0) \
    HELD(U8,  deck, bcCam,          CR, 0) \
    HELD(U8,  deck, bcBigQuad,      CR, 0) \
    HELD(U8,  deck, bcBuzzer,       CR, 0) \
    HELD(U8,  deck, bcColorLedBot,  CR, 0) \
    HELD(U8,  deck, bcColorLedTop,  CR, 0) \
    HELD(U8,  deck, cpxOverUART2,   CR, 0) \
    HELD(U8,  deck, bcFlapperDeck,  CR, 0) \
    HELD(U8,  deck, bcFlow,         CR, 0) \
    HELD(U8,  deck, bcLedRing,      CR, 0) \
    HELD(U8,  deck, bcLighthouse4,  CR, 0) \
    HELD(U8,  deck, bcDWM1000,      CR, 0) \
    HELD(U8,  deck, bcLoco,         CR, 0) \
    HELD(U8,  deck, bcServo,        CR, 0) \
    HELD(U8,  deck, bcUSD,          CR, 0) \
    HELD(U8,  deck, bcZRanger,      CR, 0) \
    HELD(U8,  deck, bcZRanger2,     CR, 0) \
    HELD(U8,  deckTest, bcColorLedBot, CR, 0) \
    HELD(U8,  deckTest, bcColorLedTop, CR, 0) \
    HELD(U8,  usd, canLog,  CR, 0) \
    HELD(U8,  usd, logging, C, 0) \
    HELD(U8,  loco, mode,           C, 0) \
    HELD(U8,  loco, fwdToEstimator, C, 1) \
    HELD(U8,  activeMarker, front, CP, 1) \
    HELD(U8,  activeMarker, back,  CP, 3) \
    HELD(U8,  activeMarker, left,  CP, 4) \
    HELD(U8,  activeMarker, right, CP, 2) \
    HELD(U8,  activeMarker, mode,  CP, 3)

// ---- LIVE(type, group, name, access, value)   HELD(type, group, name, access, value)
// with the vehicle cf, its input in, what follows from it e and the truth kin
#define IVL_CF_LOGS(LIVE, HELD) \
    LIVE(U32, sil, time_ms,  N, (uint32_t)cf->t_ms) \
    LIVE(U32, sil, episode,  N, cf->episode.number) \
    LIVE(U8,  sil, ended,    N, cf->episode.ended) \
    LIVE(F32, sil, rotor_V,  N, cf->episode.battery_V) \
    LIVE(U8,  sil, grounded, N, cf->grounded ? 1u : 0u) \
    LIVE(U32, sil, n_pose,   N, cf->estimate.n) \
    LIVE(U32, sil, n_bumps,  N, cf->n_bumps) \
    LIVE(F32, stateEstimate, x,  C, in->p_WB_m.x) \
    LIVE(F32, stateEstimate, y,  C, in->p_WB_m.y) \
    LIVE(F32, stateEstimate, z,  C, in->p_WB_m.z) \
    LIVE(F32, stateEstimate, vx, C, in->v_WB_mps.x) \
    LIVE(F32, stateEstimate, vy, C, in->v_WB_mps.y) \
    LIVE(F32, stateEstimate, vz, C, in->v_WB_mps.z) \
    LIVE(F32, stateEstimate, ax, C, e.a_g.x) \
    LIVE(F32, stateEstimate, ay, C, e.a_g.y) \
    LIVE(F32, stateEstimate, az, C, e.a_g.z) \
    LIVE(F32, stateEstimate, roll,  C, cf->state.attitude.roll) \
    LIVE(F32, stateEstimate, pitch, C, cf->state.attitude.pitch) \
    LIVE(F32, stateEstimate, yaw,   C, cf->state.attitude.yaw) \
    LIVE(F32, stateEstimate, qx, C, in->q_WB.x) \
    LIVE(F32, stateEstimate, qy, C, in->q_WB.y) \
    LIVE(F32, stateEstimate, qz, C, in->q_WB.z) \
    LIVE(F32, stateEstimate, qw, C, in->q_WB.w) \
    LIVE(I16, stateEstimateZ, x,  N, milli(in->p_WB_m.x)) \
    LIVE(I16, stateEstimateZ, y,  N, milli(in->p_WB_m.y)) \
    LIVE(I16, stateEstimateZ, z,  N, milli(in->p_WB_m.z)) \
    LIVE(I16, stateEstimateZ, vx, N, milli(in->v_WB_mps.x)) \
    LIVE(I16, stateEstimateZ, vy, N, milli(in->v_WB_mps.y)) \
    LIVE(I16, stateEstimateZ, vz, N, milli(in->v_WB_mps.z)) \
    LIVE(I16, stateEstimateZ, ax, N, milli(e.a_g.x * APP_MPS2_PER_G)) \
    LIVE(I16, stateEstimateZ, ay, N, milli(e.a_g.y * APP_MPS2_PER_G)) \
    LIVE(I16, stateEstimateZ, az, N, milli((e.a_g.z + 1.0f) * APP_MPS2_PER_G)) \
    LIVE(U32, stateEstimateZ, quat, N, packed(in->q_WB)) \
    LIVE(I16, stateEstimateZ, rateRoll,  N, milli(cf->sensors.gyro.x * APP_RADPS_PER_DEGPS)) \
    LIVE(I16, stateEstimateZ, ratePitch, N, milli(-cf->sensors.gyro.y * APP_RADPS_PER_DEGPS)) \
    LIVE(I16, stateEstimateZ, rateYaw,   N, milli(cf->sensors.gyro.z * APP_RADPS_PER_DEGPS)) \
    LIVE(F32, stabilizer, roll,   N, cf->state.attitude.roll) \
    LIVE(F32, stabilizer, pitch,  N, cf->state.attitude.pitch) \
    LIVE(F32, stabilizer, yaw,    N, cf->state.attitude.yaw) \
    LIVE(F32, stabilizer, thrust, N, 0.25f * (e.pwm[0] + e.pwm[1] + e.pwm[2] + e.pwm[3])) \
    HELD(U32, stabilizer, intToOut, N, 0) \
    LIVE(F32, gyro, x, C, cf->sensors.gyro.x) \
    LIVE(F32, gyro, y, C, cf->sensors.gyro.y) \
    LIVE(F32, gyro, z, C, cf->sensors.gyro.z) \
    LIVE(I16, gyro, xRaw, N, gyro_steps(cf->sensors.gyro.x)) \
    LIVE(I16, gyro, yRaw, N, gyro_steps(cf->sensors.gyro.y)) \
    LIVE(I16, gyro, zRaw, N, gyro_steps(cf->sensors.gyro.z)) \
    LIVE(F32, gyro, xVariance, N, e.gyro_variance) \
    LIVE(F32, gyro, yVariance, N, e.gyro_variance) \
    LIVE(F32, gyro, zVariance, N, e.gyro_variance) \
    LIVE(F32, acc, x, C, cf->acc_g[0]) \
    LIVE(F32, acc, y, C, cf->acc_g[1]) \
    LIVE(F32, acc, z, C, cf->acc_g[2]) \
    HELD(F32, mag, x, C, 0.0f) \
    HELD(F32, mag, y, C, 0.0f) \
    HELD(F32, mag, z, C, 0.0f) \
    LIVE(F32, baro, asl,      C, in->p_WB_m.z) \
    LIVE(F32, baro, pressure, C, PRESSURE_MBAR - in->p_WB_m.z * MBAR_PER_M) \
    HELD(F32, baro, temp,     N, 25.0f) \
    LIVE(U16, motor, m1, C, (uint16_t)e.pwm[0]) \
    LIVE(U16, motor, m2, C, (uint16_t)e.pwm[1]) \
    LIVE(U16, motor, m3, C, (uint16_t)e.pwm[2]) \
    LIVE(U16, motor, m4, C, (uint16_t)e.pwm[3]) \
    LIVE(I32, motor, m1req, N, (int32_t)e.pwm[0]) \
    LIVE(I32, motor, m2req, N, (int32_t)e.pwm[1]) \
    LIVE(I32, motor, m3req, N, (int32_t)e.pwm[2]) \
    LIVE(I32, motor, m4req, N, (int32_t)e.pwm[3]) \
    LIVE(F32, pm, vbat,   C, cf->power.vbat_V) \
    LIVE(U16, pm, vbatMV, N, (uint16_t)(cf->power.vbat_V * 1000.0f)) \
    LIVE(I8,  pm, state,  C, ivl_cf_power_state(&cf->power)) \
    LIVE(U8,  pm, batteryLevel, C, ivl_cf_power_level(&cf->power)) \
    HELD(F32, pm, extVbat,   N, 0.0f) \
    HELD(U16, pm, extVbatMV, N, 0) \
    HELD(F32, pm, extCurr,   N, 0.0f) \
    HELD(F32, pm, chargeCurrent, N, 0.0f) \
    HELD(F32, pm, temp,      N, 25.0f) \
    LIVE(U16, range, up,     C, cf->range_mm[IVL_CF_UP]) \
    LIVE(U16, range, front,  C, cf->range_mm[IVL_CF_FRONT]) \
    LIVE(U16, range, back,   C, cf->range_mm[IVL_CF_BACK]) \
    LIVE(U16, range, left,   C, cf->range_mm[IVL_CF_LEFT]) \
    LIVE(U16, range, right,  C, cf->range_mm[IVL_CF_RIGHT]) \
    LIVE(U16, range, zrange, C, cf->range_mm[IVL_CF_DOWN]) \
    LIVE(I16, motion, deltaX, N, cf->flow_pixels[0]) \
    LIVE(I16, motion, deltaY, N, cf->flow_pixels[1]) \
    LIVE(U8,  motion, motion, N, (cf->set.has_flow_deck != 0u) ? FLOW_MOVES : 0u) \
    LIVE(U8,  motion, squal,  N, (cf->set.has_flow_deck != 0u) ? FLOW_QUALITY : 0u) \
    HELD(U16, motion, shutter, N, 0) \
    HELD(U8,  motion, maxRaw,  N, 0) \
    HELD(U8,  motion, minRaw,  N, 0) \
    HELD(U8,  motion, Rawsum,  N, 0) \
    HELD(U8,  motion, outlierCount, N, 0) \
    HELD(F32, motion, std,     N, 2.0f) \
    LIVE(U16, supervisor, info, N, ivl_cf_supervisor_info(cf)) \
    LIVE(F32, supervisor, accNorm, N, cf->supervisor.force_g) \
    LIVE(U8,  sys, canfly,    C, ivl_cf_supervisor_can_fly(&cf->supervisor) ? 1u : 0u) \
    LIVE(U8,  sys, isFlying,  C, ivl_cf_supervisor_is_flying(&cf->supervisor) ? 1u : 0u) \
    LIVE(U8,  sys, isTumbled, C, cf->supervisor.tumbled ? 1u : 0u) \
    LIVE(I8,  sys, testLogParam, N, (int8_t)cf->held.system_testLogParam) \
    LIVE(F32, ctrltarget, x,  C, sp->p_W_m.x) \
    LIVE(F32, ctrltarget, y,  C, sp->p_W_m.y) \
    LIVE(F32, ctrltarget, z,  C, sp->p_W_m.z) \
    LIVE(F32, ctrltarget, vx, C, sp->v_mps.x) \
    LIVE(F32, ctrltarget, vy, C, sp->v_mps.y) \
    LIVE(F32, ctrltarget, vz, C, sp->v_mps.z) \
    LIVE(F32, ctrltarget, ax, C, sp->a_W_mps2.x) \
    LIVE(F32, ctrltarget, ay, C, sp->a_W_mps2.y) \
    LIVE(F32, ctrltarget, az, C, sp->a_W_mps2.z) \
    LIVE(F32, ctrltarget, roll,   C, angle_deg(sp->roll_mode, sp->roll)) \
    LIVE(F32, ctrltarget, pitch,  C, -angle_deg(sp->pitch_mode, sp->pitch)) \
    LIVE(F32, ctrltarget, yaw,    C, sp->yawrate_radps * DEG_PER_RAD) \
    LIVE(F32, ctrltarget, thrust, C, sp->thrust_norm * PWM_FULL) \
    LIVE(U8,  ctrltarget, mode_x, N, (uint8_t)sp->xy) \
    LIVE(U8,  ctrltarget, mode_y, N, (uint8_t)sp->xy) \
    LIVE(U8,  ctrltarget, mode_z, N, (uint8_t)sp->z) \
    LIVE(U8,  ctrltarget, mode_roll,  N, (uint8_t)sp->roll_mode) \
    LIVE(U8,  ctrltarget, mode_pitch, N, (uint8_t)sp->pitch_mode) \
    LIVE(U8,  ctrltarget, mode_yaw,   N, (uint8_t)sp->yaw) \
    HELD(U8,  ctrltarget, mode_quat,  N, 0) \
    LIVE(I16, ctrltargetZ, x,  N, milli(sp->p_W_m.x)) \
    LIVE(I16, ctrltargetZ, y,  N, milli(sp->p_W_m.y)) \
    LIVE(I16, ctrltargetZ, z,  N, milli(sp->p_W_m.z)) \
    LIVE(I16, ctrltargetZ, vx, N, milli(sp->v_mps.x)) \
    LIVE(I16, ctrltargetZ, vy, N, milli(sp->v_mps.y)) \
    LIVE(I16, ctrltargetZ, vz, N, milli(sp->v_mps.z)) \
    LIVE(I16, ctrltargetZ, ax, N, milli(sp->a_W_mps2.x)) \
    LIVE(I16, ctrltargetZ, ay, N, milli(sp->a_W_mps2.y)) \
    LIVE(I16, ctrltargetZ, az, N, milli(sp->a_W_mps2.z)) \
    LIVE(F32, controller, cmd_thrust, N, 0.25f * (e.pwm[0] + e.pwm[1] + e.pwm[2] + e.pwm[3])) \
    LIVE(F32, controller, cmd_roll,   N, (float)cf->stock_control.roll) \
    LIVE(F32, controller, cmd_pitch,  N, (float)cf->stock_control.pitch) \
    LIVE(F32, controller, cmd_yaw,    N, (float)cf->stock_control.yaw) \
    LIVE(I16, controller, ctr_yaw,    N, cf->stock_control.yaw) \
    LIVE(F32, controller, r_roll,  N, cf->sensors.gyro.x * APP_RADPS_PER_DEGPS) \
    LIVE(F32, controller, r_pitch, N, -cf->sensors.gyro.y * APP_RADPS_PER_DEGPS) \
    LIVE(F32, controller, r_yaw,   N, cf->sensors.gyro.z * APP_RADPS_PER_DEGPS) \
    LIVE(F32, controller, accelz,  N, cf->acc_g[2]) \
    LIVE(F32, controller, actuatorThrust, N, cf->stock_control.thrust) \
    LIVE(F32, controller, roll,  N, cf->stock.roll * DEG_PER_RAD) \
    LIVE(F32, controller, pitch, N, -cf->stock.pitch * DEG_PER_RAD) \
    LIVE(F32, controller, yaw,   N, cf->stock.yaw_rad * DEG_PER_RAD) \
    HELD(F32, controller, rollRate,  N, 0.0f) \
    HELD(F32, controller, pitchRate, N, 0.0f) \
    HELD(F32, controller, yawRate,   N, 0.0f) \
    LIVE(F32, posCtl, targetX, N, cf->stock.p_W_m.x) \
    LIVE(F32, posCtl, targetY, N, cf->stock.p_W_m.y) \
    LIVE(F32, posCtl, targetZ, N, cf->stock.p_W_m.z) \
    LIVE(F32, posCtl, targetVX, N, sp->v_mps.x) \
    LIVE(F32, posCtl, targetVY, N, sp->v_mps.y) \
    LIVE(F32, posCtl, targetVZ, N, sp->v_mps.z) \
    LIVE(F32, posCtl, bodyVX, N, e.v_heading.x) \
    LIVE(F32, posCtl, bodyVY, N, e.v_heading.y) \
    LIVE(F32, posCtl, bodyX,  N, e.p_heading.x) \
    LIVE(F32, posCtl, bodyY,  N, e.p_heading.y) \
    HELD(F32, posCtl, Xp, N, 0.0f) \
    HELD(F32, posCtl, Xi, N, 0.0f) \
    HELD(F32, posCtl, Xd, N, 0.0f) \
    HELD(F32, posCtl, Xff, N, 0.0f) \
    HELD(F32, posCtl, Yp, N, 0.0f) \
    HELD(F32, posCtl, Yi, N, 0.0f) \
    HELD(F32, posCtl, Yd, N, 0.0f) \
    HELD(F32, posCtl, Yff, N, 0.0f) \
    HELD(F32, posCtl, Zp, N, 0.0f) \
    HELD(F32, posCtl, Zi, N, 0.0f) \
    HELD(F32, posCtl, Zd, N, 0.0f) \
    HELD(F32, posCtl, Zff, N, 0.0f) \
    HELD(F32, posCtl, VXp, N, 0.0f) \
    HELD(F32, posCtl, VXi, N, 0.0f) \
    HELD(F32, posCtl, VXd, N, 0.0f) \
    HELD(F32, posCtl, VXff, N, 0.0f) \
    HELD(F32, posCtl, VYp, N, 0.0f) \
    HELD(F32, posCtl, VYi, N, 0.0f) \
    HELD(F32, posCtl, VYd, N, 0.0f) \
    HELD(F32, posCtl, VYff, N, 0.0f) \
    HELD(F32, posCtl, VZp, N, 0.0f) \
    HELD(F32, posCtl, VZi, N, 0.0f) \
    HELD(F32, posCtl, VZd, N, 0.0f) \
    HELD(F32, posCtl, VZff, N, 0.0f) \
    HELD(F32, pid_attitude, roll_outP, N, 0.0f) \
    HELD(F32, pid_attitude, roll_outI, N, 0.0f) \
    HELD(F32, pid_attitude, roll_outD, N, 0.0f) \
    HELD(F32, pid_attitude, roll_outFF, N, 0.0f) \
    HELD(F32, pid_attitude, pitch_outP, N, 0.0f) \
    HELD(F32, pid_attitude, pitch_outI, N, 0.0f) \
    HELD(F32, pid_attitude, pitch_outD, N, 0.0f) \
    HELD(F32, pid_attitude, pitch_outFF, N, 0.0f) \
    HELD(F32, pid_attitude, yaw_outP, N, 0.0f) \
    HELD(F32, pid_attitude, yaw_outI, N, 0.0f) \
    HELD(F32, pid_attitude, yaw_outD, N, 0.0f) \
    HELD(F32, pid_attitude, yaw_outFF, N, 0.0f) \
    HELD(F32, pid_rate, roll_outP, N, 0.0f) \
    HELD(F32, pid_rate, roll_outI, N, 0.0f) \
    HELD(F32, pid_rate, roll_outD, N, 0.0f) \
    HELD(F32, pid_rate, roll_outFF, N, 0.0f) \
    HELD(F32, pid_rate, pitch_outP, N, 0.0f) \
    HELD(F32, pid_rate, pitch_outI, N, 0.0f) \
    HELD(F32, pid_rate, pitch_outD, N, 0.0f) \
    HELD(F32, pid_rate, pitch_outFF, N, 0.0f) \
    HELD(F32, pid_rate, yaw_outP, N, 0.0f) \
    HELD(F32, pid_rate, yaw_outI, N, 0.0f) \
    HELD(F32, pid_rate, yaw_outD, N, 0.0f) \
    HELD(F32, pid_rate, yaw_outFF, N, 0.0f) \
    LIVE(F32, kalman, stateX,  N, in->p_WB_m.x) \
    LIVE(F32, kalman, stateY,  N, in->p_WB_m.y) \
    LIVE(F32, kalman, stateZ,  N, in->p_WB_m.z) \
    LIVE(F32, kalman, statePX, N, e.v_B.x) \
    LIVE(F32, kalman, statePY, N, e.v_B.y) \
    LIVE(F32, kalman, statePZ, N, e.v_B.z) \
    HELD(F32, kalman, stateD0, N, 0.0f) \
    HELD(F32, kalman, stateD1, N, 0.0f) \
    HELD(F32, kalman, stateD2, N, 0.0f) \
    LIVE(F32, kalman, varX, N, cf->variance_m2) \
    LIVE(F32, kalman, varY, N, cf->variance_m2) \
    LIVE(F32, kalman, varZ, N, cf->variance_m2) \
    HELD(F32, kalman, varD0, N, 1.0e-4f) \
    HELD(F32, kalman, varD1, N, 1.0e-4f) \
    HELD(F32, kalman, varD2, N, 1.0e-4f) \
    LIVE(F32, kalman, q0, N, in->q_WB.w) \
    LIVE(F32, kalman, q1, N, in->q_WB.x) \
    LIVE(F32, kalman, q2, N, in->q_WB.y) \
    LIVE(F32, kalman, q3, N, in->q_WB.z) \
    LIVE(F32, locSrv, x,  C, cf->estimate.p_W_m.x) \
    LIVE(F32, locSrv, y,  C, cf->estimate.p_W_m.y) \
    LIVE(F32, locSrv, z,  C, cf->estimate.p_W_m.z) \
    LIVE(F32, locSrv, qx, C, cf->estimate.q_WB.x) \
    LIVE(F32, locSrv, qy, C, cf->estimate.q_WB.y) \
    LIVE(F32, locSrv, qz, C, cf->estimate.q_WB.z) \
    LIVE(F32, locSrv, qw, C, cf->estimate.q_WB.w) \
    LIVE(U16, locSrvZ, tick, C, (uint16_t)(cf->estimate.t_us / 1000u)) \
    LIVE(F32, ext_pos, X, N, cf->estimate.p_W_m.x) \
    LIVE(F32, ext_pos, Y, N, cf->estimate.p_W_m.y) \
    LIVE(F32, ext_pos, Z, N, cf->estimate.p_W_m.z) \
    LIVE(U32, memTst, errCntW, N, cf->tester_errors) \
    LIVE(U8,  radio, isConnected, C, cf->link_up ? 1u : 0u) \
    HELD(U8,  radio, rssi,    C, 40) \
    HELD(U16, radio, numRxBc, C, 0) \
    HELD(U16, radio, numRxUc, C, 0) \
    HELD(U16, crtp, rxRate, N, 0) \
    HELD(U16, crtp, txRate, N, 0) \
    HELD(U8,  health, motorPass,   C, 0) \
    HELD(U8,  health, batteryPass, C, 0) \
    HELD(F32, health, motorVarXM1, N, 0.0f) \
    HELD(F32, health, motorVarYM1, N, 0.0f) \
    HELD(F32, health, motorVarXM2, N, 0.0f) \
    HELD(F32, health, motorVarYM2, N, 0.0f) \
    HELD(F32, health, motorVarXM3, N, 0.0f) \
    HELD(F32, health, motorVarYM3, N, 0.0f) \
    HELD(F32, health, motorVarXM4, N, 0.0f) \
    HELD(F32, health, motorVarYM4, N, 0.0f) \
    HELD(F32, health, batterySag,  N, 0.0f) \
    HELD(U16, health, motorTestCount, N, 0) \
    HELD(U16, lighthouse, bsAvailable, C, 0) \
    HELD(U16, lighthouse, bsReceive,   C, 0) \
    HELD(U16, lighthouse, bsActive,    C, 0) \
    HELD(U16, lighthouse, bsCalUd,     C, 0) \
    HELD(U16, lighthouse, bsCalCon,    C, 0) \
    HELD(U16, lighthouse, bsGeoVal,    C, 0) \
    HELD(U16, lighthouse, bsCalVal,    C, 0) \
    HELD(U8,  lighthouse, status,      C, 0) \
    HELD(F32, lighthouse, x, C, 0.0f) \
    HELD(F32, lighthouse, y, C, 0.0f) \
    HELD(F32, lighthouse, z, C, 0.0f) \
    HELD(U8,  loco, mode, C, 0) \
    HELD(F32, ring, fadeTime, N, 0.0f) \
    LIVE(F32, simTruth, x,  N, (float)kin.p_WB_m[0]) \
    LIVE(F32, simTruth, y,  N, (float)kin.p_WB_m[1]) \
    LIVE(F32, simTruth, z,  N, (float)kin.p_WB_m[2]) \
    LIVE(F32, simTruth, vx, N, (float)kin.v_WB_mps[0]) \
    LIVE(F32, simTruth, vy, N, (float)kin.v_WB_mps[1]) \
    LIVE(F32, simTruth, vz, N, (float)kin.v_WB_mps[2]) \
    LIVE(F32, simTruth, qx, N, (float)kin.q_WB[0]) \
    LIVE(F32, simTruth, qy, N, (float)kin.q_WB[1]) \
    LIVE(F32, simTruth, qz, N, (float)kin.q_WB[2]) \
    LIVE(F32, simTruth, qw, N, (float)kin.q_WB[3]) \
    LIVE(U8,  simTruth, feet, N, (uint8_t)ivl_sim_world_count_stuck(&cf->group.world[IVL_CF_LANE]))
// clang-format on
#endif  // IVL_CF_NAMES_H
