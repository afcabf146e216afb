/// @file platform_defaults.h
/// Stands before the file of the same name in firmware/sdk: here the airframe is the simulated vehicle.
#ifndef SDK_PLATFORM_DEFAULTS_H
#define SDK_PLATFORM_DEFAULTS_H
typedef struct
{
    float arm_length_m;  ///< centre to motor
    float mass_kg;
    float thrust_N_max;  ///< of one motor
    float torque_per_thrust_m;
} ivl_cf_platform_t;

extern ivl_cf_platform_t ivl_cf_platform;

#define ARM_LENGTH    (ivl_cf_platform.arm_length_m)
#define CF_MASS       (ivl_cf_platform.mass_kg)
#define THRUST_MAX    (ivl_cf_platform.thrust_N_max)
#define THRUST2TORQUE (ivl_cf_platform.torque_per_thrust_m)
#endif  // SDK_PLATFORM_DEFAULTS_H
