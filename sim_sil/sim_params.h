/// @file sim_params.h
/// Every raw parameter of the simulated world, once: name, unit, allowed range, default, meaning.
///
/// X(group, name, unit_suffix, unit, min, max, default, doc) makes the field `group_name_unit_suffix` of
/// ivl_sim_params_t (double) and the entry "group.name" of the table that the host reads.  A default of IVL_SIM_REQUIRED
/// (NaN) means that the vehicle or gear file must give the value.  Derived values are not here: see ivl_sim_model_t.
#ifndef IVL_SIM_PARAMS_H
#define IVL_SIM_PARAMS_H

#include <math.h>

#include "camera_params.h"

#define IVL_SIM_REQUIRED  ((double)NAN)
#define IVL_SIM_UNLIMITED ((double)INFINITY)

// clang-format off
#define IVL_SIM_PARAMS(X) \
    X(world, gravity, mps2, "m/s^2", 0.0, 30.0, 9.81, "acceleration of gravity") \
    X(world, ceiling_height, m, "m", 0.5, 20.0, 3.0, "height of the surface, of one that is no ceiling at x = 0") \
    X(world, sensed_gap_offset, m, "m", -0.1, 0.1, 0.0, "height of the plane that the cues refer to, above the surface") \
    X(surface, angle, deg, "deg", 0.0, 180.0, 180.0, "angle of the surface: 180 ceiling, 90 wall ahead, 0 floor; its normal is (sin, 0, -cos) of this") \
    X(surface, speed_along, mps, "m/s", -5.0, 5.0, 0.0, "velocity of the surface forward along itself") \
    X(surface, speed_away, mps, "m/s", -5.0, 5.0, 0.0, "velocity of the surface along its normal; below 0 it comes towards the vehicle") \
    X(body, mass, kg, "kg", 0.001, 10.0, IVL_SIM_REQUIRED, "airframe with battery, without legs; centre of mass at the body origin") \
    X(body, inertia_xx, kgm2, "kg m^2", 1.0e-7, 1.0, IVL_SIM_REQUIRED, "principal moment of inertia of the airframe about body x") \
    X(body, inertia_yy, kgm2, "kg m^2", 1.0e-7, 1.0, IVL_SIM_REQUIRED, "about body y") \
    X(body, inertia_zz, kgm2, "kg m^2", 1.0e-7, 1.0, IVL_SIM_REQUIRED, "about body z") \
    X(rotor, x, m, "m", 0.001, 1.0, IVL_SIM_REQUIRED, "distance of each motor from the body y axis") \
    X(rotor, y, m, "m", 0.001, 1.0, IVL_SIM_REQUIRED, "distance of each motor from the body x axis") \
    X(rotor, z, m, "m", -0.5, 0.5, IVL_SIM_REQUIRED, "height of the motors above the body origin") \
    X(rotor, thrust_max, N, "N", 0.001, 100.0, IVL_SIM_REQUIRED, "largest thrust of one motor; commands beyond it saturate") \
    X(rotor, thrust_constant, Ns2, "N s^2", 1.0e-10, 1.0e-3, IVL_SIM_REQUIRED, "thrust / (rotor speed in rad/s)^2") \
    X(rotor, torque_constant, m, "m", 0.0, 0.1, IVL_SIM_REQUIRED, "reaction torque / thrust") \
    X(rotor, tau_up, s, "s", 1.0e-6, 1.0, IVL_SIM_REQUIRED, "time constant of the rotor speed, speeding up") \
    X(rotor, tau_down, s, "s", 1.0e-6, 1.0, IVL_SIM_REQUIRED, "time constant of the rotor speed, slowing down") \
    X(rotor, drag_share, norm, "1", 0.0, 0.95, 0.0, "share of the slowing down that grows with the square of the speed; 0: a pure exponential") \
    X(rotor, thrust_gain, norm, "1", 0.5, 1.5, 1.0, "delivered thrust / commanded thrust at the rated voltage, below saturation") \
    X(rotor, inflow_loss, spm, "s/m", 0.0, 0.3, 0.0, "relative loss of thrust for each m/s of climb along the rotors' axis") \
    X(rotor, thrust_least, N, "N", 0.0, 1.0, 0.0, "least thrust that can be asked of a motor; what is below it asks for nothing") \
    X(rotor, thrust_idle, N, "N", 0.0, 1.0, 0.0, "thrust of an armed motor of which nothing is asked, where the autopilot does not stop it") \
    X(rotor, thrust_scatter, norm, "1", 0.0, 0.5, 0.0, "standard deviation of each motor's relative thrust error, drawn once a rollout") \
    X(battery, voltage, V, "V", 0.0, 30.0, 0.0, "open-circuit voltage during a rollout; 0: a supply that never sags") \
    X(battery, voltage_scatter, V, "V", 0.0, 5.0, 0.0, "its standard deviation, drawn once a rollout") \
    X(battery, sag, VpN, "V/N", 0.0, 20.0, 0.0, "fall of the voltage under load, for each newton that all rotors make together") \
    X(battery, rated_voltage, V, "V", 0.5, 30.0, 3.7, "voltage under load at which rotor.thrust_max holds") \
    X(battery, speed_slope, norm, "1", 0.0, 2.0, 0.8, "relative change of a rotor's speed / relative change of its voltage, duty cycle held") \
    X(battery, compensated, norm, "1", 0.0, 1.0, 0.0, "1: the autopilot raises the duty cycle as the voltage falls, until it saturates; 0: it does not") \
    X(prop_plate, size_x, m, "m", 0.0, 1.0, IVL_SIM_REQUIRED, "box that stands for the rotors' disc: length") \
    X(prop_plate, size_y, m, "m", 0.0, 1.0, IVL_SIM_REQUIRED, "width") \
    X(prop_plate, size_z, m, "m", 0.0, 1.0, IVL_SIM_REQUIRED, "thickness") \
    X(prop_plate, center_z, m, "m", -0.5, 0.5, IVL_SIM_REQUIRED, "height of its centre above the body origin") \
    X(base_plate, size_x, m, "m", 0.0, 1.0, IVL_SIM_REQUIRED, "box that stands for the airframe's underside: length") \
    X(base_plate, size_y, m, "m", 0.0, 1.0, IVL_SIM_REQUIRED, "width") \
    X(base_plate, size_z, m, "m", 0.0, 1.0, IVL_SIM_REQUIRED, "thickness") \
    X(base_plate, center_z, m, "m", -0.5, 0.5, IVL_SIM_REQUIRED, "height of its centre above the body origin") \
    X(plate, stiffness, Npm, "N/m", 1.0, 1.0e5, 5000.0, "contact stiffness of one plate corner on the ceiling") \
    X(plate, damping, spm, "s/m", 0.0, 10.0, 0.7, "Hunt-Crossley damping: force = k x (1 + damping dx/dt)") \
    X(plate, friction, norm, "1", 0.0, 2.0, 0.3, "Coulomb coefficient of a corner sliding on the ceiling") \
    X(plate, slip_speed, mps, "m/s", 0.05, 5.0, 0.3, "sliding speed at which friction reaches 71 % of Coulomb's value") \
    X(aero, drag_xy, Nspm, "N s/m", 0.0, 1.0, 0.0, "air drag of the body per speed, along body x and y") \
    X(aero, drag_z, Nspm, "N s/m", 0.0, 1.0, 0.0, "air drag of the body per speed, along body z") \
    X(aero, yaw_torque, norm, "1", 0.0, 1.0, 1.0, "share of the rotors' reaction torque that acts on the body; 0 switches it off") \
    X(aero, ceiling_gain, norm, "1", 0.0, 2.0, 0.0, "ceiling effect: thrust grows by gain (rotor radius / gap)^2") \
    X(aero, rotor_radius, m, "m", 0.001, 0.5, 0.0231, "radius of a rotor, for the ceiling effect") \
    X(leg, length, m, "m", 0.005, 0.5, IVL_SIM_REQUIRED, "from the hip's pivot to the centre of the foot") \
    X(leg, angle, deg, "deg", 0.0, 90.0, IVL_SIM_REQUIRED, "rest angle psi between leg and -z of the body, outward") \
    X(leg, mass, kg, "kg", 1.0e-5, 0.1, IVL_SIM_REQUIRED, "of one leg, a uniform rod") \
    X(leg, stiffness, Nmprad, "N m/rad", 0.0, 10.0, IVL_SIM_REQUIRED, "torsional spring of each of the hip's two hinges") \
    X(leg, damping, Nmsprad, "N m s/rad", 0.0, 0.1, IVL_SIM_REQUIRED, "torsional damper of each of the hip's two hinges") \
    X(leg, hip_xy, m, "m", 0.0, 0.5, IVL_SIM_REQUIRED, "distance of the hip's pivot from the body x axis and from the y axis") \
    X(leg, hip_z, m, "m", -0.5, 0.5, IVL_SIM_REQUIRED, "height of the hip's pivot above the body origin") \
    X(leg, foot_radius, m, "m", 0.0, 0.05, IVL_SIM_REQUIRED, "of the adhesive sphere at the end of the leg") \
    X(leg, foot_mass, kg, "kg", 0.0, 0.1, IVL_SIM_REQUIRED, "of the adhesive sphere") \
    X(leg, adhesion, N, "N", 0.0, IVL_SIM_UNLIMITED, IVL_SIM_UNLIMITED, "pull along the ceiling's normal at which a stuck foot comes off; .inf never") \
    X(leg, stick_delay, s, "s", 0.0, 1.0, 0.0, "time for which a foot must press on the ceiling before it sticks") \
    X(leg, foot_damping, Nmsprad, "N m s/rad", 0.0, 0.1, 0.0, "friction of a stuck foot's ball joint against the swing of the leg") \
    X(sense, pose_rate, hz, "Hz", 1.0, 1000.0, 100.0, "rate of the position and velocity samples, held in between") \
    X(sense, phase_random, norm, "1", 0.0, 1.0, 1.0, "1: the sensor's clock has a random offset in each rollout; 0: it starts with the rollout") \
    X(sense, latency, s, "s", 0.0, 0.1, 0.0, "from the sampling instant to the delivery of a pose sample") \
    X(sense, position_noise, m, "m", 0.0, 1.0, 0.0, "standard deviation of each component of a position sample") \
    X(sense, velocity_noise, mps, "m/s", 0.0, 5.0, 0.0, "standard deviation of each component of a velocity sample") \
    X(sense, attitude_noise, rad, "rad", 0.0, 0.5, 0.0, "standard deviation of each component of the attitude error") \
    X(sense, gyro_noise, radps, "rad/s", 0.0, 5.0, 0.0, "standard deviation of each component of the angular rate") \
    X(sense, gyro_max, radps, "rad/s", 1.0, IVL_SIM_UNLIMITED, IVL_SIM_UNLIMITED, "full scale of the gyro; readings clip there") \
    X(sense, accel_noise, mps2, "m/s^2", 0.0, 50.0, 0.0, "standard deviation of each component of the specific force") \
    X(sense, accel_max, mps2, "m/s^2", 1.0, IVL_SIM_UNLIMITED, IVL_SIM_UNLIMITED, "full scale of the accelerometer; readings clip there") \
    X(sense, position_resolution, m, "m", 0.0, 0.1, 0.0, "positions are multiples of this; 0: not rounded") \
    X(sense, pose_drop, norm, "1", 0.0, 1.0, 0.0, "chance that a pose sample is lost: the last one stays") \
    X(sense, inertial, norm, "1", 0.0, 1.0, 0.0, "1: no external pose; position and velocity by dead reckoning from a hover, at each tick") \
    X(sense, start_position_error, m, "m", 0.0, 5.0, 0.0, "dead reckoning: standard deviation of each coordinate at the start; that of z is the ceiling's, too") \
    X(sense, start_velocity_error, mps, "m/s", 0.0, 2.0, 0.0, "dead reckoning: standard deviation of each component of the velocity at the start") \
    X(sense, start_attitude_error, rad, "rad", 0.0, 0.5, 0.0, "integrated attitude: standard deviation of each component at the start") \
    X(sense, attitude_integrated, norm, "1", 0.0, 1.0, 0.0, "1: the attitude is integrated from the gyro as delivered, clipped where that is") \
    X(sense, gyro_bias, radps, "rad/s", 0.0, 1.0, 0.0, "standard deviation of each component's offset, drawn once a rollout") \
    X(sense, gyro_cutoff, hz, "Hz", 1.0, IVL_SIM_UNLIMITED, IVL_SIM_UNLIMITED, "corner of the gyro's low-pass (second order, Butterworth); .inf: none") \
    X(sense, accel_bias, mps2, "m/s^2", 0.0, 5.0, 0.0, "standard deviation of each component's offset, drawn once a rollout") \
    X(sense, accel_cutoff, hz, "Hz", 1.0, IVL_SIM_UNLIMITED, IVL_SIM_UNLIMITED, "corner of the accelerometer's low-pass; .inf: none") \
    X(rrev, rate, hz, "Hz", 0.0, 500.0, 0.0, "sensor of RREV, standing for a camera: samples per second; 0: there is none") \
    X(rrev, delay, s, "s", 0.0, 0.06, 0.0, "from the sampling instant to the arrival") \
    X(rrev, noise, per_s, "1/s", 0.0, 10.0, 0.0, "standard deviation: constant part") \
    X(rrev, noise_rel, norm, "1", 0.0, 1.0, 0.0, "and part of the value; the two are independent") \
    X(rrev, resolution, per_s, "1/s", 0.0, 1.0, 0.0, "values are multiples of this; 0: not rounded") \
    X(rrev, max, per_s, "1/s", 0.1, IVL_SIM_UNLIMITED, IVL_SIM_UNLIMITED, "a value beyond this is told as invalid") \
    X(rrev, mean_rel, norm, "1", -0.5, 0.5, 0.0, "mean error, part of the value") \
    X(rrev, bias_rel, norm, "1", 0.0, 0.5, 0.0, "standard deviation of an error that is a part of the value, drawn once a rollout") \
    X(rrev, correlation, norm, "1", 0.0, 0.99, 0.0, "of the noise of two samples in a row") \
    X(rrev, outlier, norm, "1", 0.0, 1.0, 0.0, "chance that a sample has a further error") \
    X(rrev, outlier_rel, norm, "1", 0.0, 10.0, 0.0, "standard deviation of that error, part of the value") \
    X(rrev, drop, norm, "1", 0.0, 1.0, 0.0, "chance that a sample is told as invalid") \
    X(range, rate, hz, "Hz", 0.0, 500.0, 0.0, "ranging sensor along b_z: samples per second; 0: there is none") \
    X(range, delay, s, "s", 0.0, 0.12, 0.0, "from the sampling instant to the arrival") \
    X(range, noise, m, "m", 0.0, 1.0, 0.0, "standard deviation of a sample") \
    X(range, bias, m, "m", 0.0, 1.0, 0.0, "standard deviation of the offset, drawn once a rollout") \
    X(range, resolution, m, "m", 0.0, 0.1, 0.0, "values are multiples of this; 0: not rounded") \
    X(range, min, m, "m", 0.0, 1.0, 0.0, "a value below this is told as invalid") \
    X(range, max, m, "m", 0.1, IVL_SIM_UNLIMITED, IVL_SIM_UNLIMITED, "a value beyond this is told as invalid") \
    X(range, drop, norm, "1", 0.0, 1.0, 0.0, "chance that a sample is told as invalid") \
    X(flow, rate, hz, "Hz", 0.0, 500.0, 0.0, "flow sensor that faces up, lateral flow only: samples per second; 0: there is none") \
    X(flow, delay, s, "s", 0.0, 0.06, 0.0, "from the sampling instant to the arrival") \
    X(flow, noise, radps, "rad/s", 0.0, 10.0, 0.0, "standard deviation of a sample") \
    X(flow, resolution, radps, "rad/s", 0.0, 1.0, 0.0, "values are multiples of this; 0: not rounded") \
    X(flow, max, radps, "rad/s", 0.1, IVL_SIM_UNLIMITED, IVL_SIM_UNLIMITED, "a value beyond this is told as invalid") \
    X(flow, bias, radps, "rad/s", 0.0, 5.0, 0.0, "standard deviation of the offset, drawn once a rollout") \
    X(flow, correlation, norm, "1", 0.0, 0.99, 0.0, "of the noise of two samples in a row") \
    X(flow, outlier, norm, "1", 0.0, 1.0, 0.0, "chance that a sample has a further error") \
    X(flow, outlier_size, radps, "rad/s", 0.0, 50.0, 0.0, "standard deviation of that error") \
    X(flow, drop, norm, "1", 0.0, 1.0, 0.0, "chance that a sample is told as invalid") \
    IVL_CAMERA_LOOP_PARAMS(X) \
    IVL_CAMERA_PARAMS(X) \
    X(start, hold_time, s, "s", 0.0, 5.0, 0.39, "flown start: time at full speed that is left, before the ceiling would be reached") \
    X(start, room, m, "m", 0.0, 10.0, 0.0, "flown start: at least this far below the plane of the cues, for an approach faster than commanded") \
    X(end, contact_time, s, "s", 0.01, 10.0, 1.0, "a rollout ends this long after the first contact") \
    X(end, missed_time, s, "s", 0.1, 10.0, 2.25, "or this long after the trigger, without a contact") \
    X(end, time_max, s, "s", 0.1, 60.0, 5.0, "or this long after its start") \
    X(step, flight, s, "s", 1.0e-6, 0.002, 0.002, "largest integration step before the first contact") \
    X(step, touch, s, "s", 1.0e-6, 0.002, 0.0005, "integration step right after a contact event") \
    X(step, plate, s, "s", 1.0e-6, 0.0005, 0.0001, "largest integration step while a plate presses on the ceiling") \
    X(step, swing, s, "s", 1.0e-6, 0.004, 0.002, "largest integration step after the first contact") \
    X(step, turn, rad, "rad", 1.0e-4, 1.0, 0.02, "largest turn of the body in one step while four feet are stuck") \
    X(step, growth, norm, "1", 1.0, 2.0, 1.2, "factor by which the step grows from one to the next") \
    X(step, scale, norm, "1", 0.001, 1.0, 1.0, "multiplies all steps; for convergence studies")
// clang-format on

#define IVL_SIM_FIELD(group, name, suffix, unit, lo, hi, dflt, doc) double group##_##name##_##suffix;  ///< doc

/// Raw parameters, in the order of the table.
typedef struct
{
    IVL_SIM_PARAMS(IVL_SIM_FIELD)
} ivl_sim_params_t;

#undef IVL_SIM_FIELD

#endif  // IVL_SIM_PARAMS_H
