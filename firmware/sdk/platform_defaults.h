/// @file platform_defaults.h
/// Declared for the app: the airframe.  Values of a Crazyflie 2.1 with the thrust upgrade, in float as in the SDK.
#ifndef SDK_PLATFORM_DEFAULTS_H
#define SDK_PLATFORM_DEFAULTS_H
#define ARM_LENGTH    0.046f      // m, centre to motor
#define CF_MASS       0.0325f     // kg
#define THRUST_MAX    0.18f       // N, one motor
#define THRUST2TORQUE 0.0051648f  // m
#endif                            // SDK_PLATFORM_DEFAULTS_H
