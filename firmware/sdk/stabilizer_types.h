/// @file stabilizer_types.h
/// Declared for the app: what the stabilizer loop hands round.  Only the members that the app uses, in the SDK's types and order.
#ifndef SDK_STABILIZER_TYPES_H
#define SDK_STABILIZER_TYPES_H
#include <stdbool.h>
#include <stdint.h>

typedef uint32_t stabilizerStep_t;

typedef struct
{
    float x, y, z;
} Axis3f;

struct vec3_s
{
    uint32_t timestamp;
    float    x, y, z;
};
typedef struct vec3_s point_t;
typedef struct vec3_s velocity_t;

/// Degrees; the pitch has the other sign than a rotation about y, left.
typedef struct
{
    uint32_t timestamp;
    float    roll, pitch, yaw;
} attitude_t;

typedef struct
{
    float x, y, z, w;
} quaternion_t;

typedef struct
{
    Axis3f acc;   ///< g
    Axis3f gyro;  ///< deg/s
} sensorData_t;

typedef struct
{
    attitude_t   attitude;
    quaternion_t attitudeQuaternion;
    point_t      position;  ///< m
    velocity_t   velocity;  ///< m/s
} state_t;

typedef enum
{
    modeDisable = 0,
    modeAbs,
    modeVelocity
} stab_mode_t;

typedef struct
{
    stab_mode_t x, y, z, roll, pitch, yaw, quat;
} setpoint_mode_t;

typedef struct
{
    uint32_t        timestamp;  ///< kernel ticks
    float           thrust;     ///< 0..65535
    setpoint_mode_t mode;
} setpoint_t;

#define STABILIZER_NR_OF_MOTORS 4

typedef enum
{
    controlModeLegacy = 0,
    controlModeForceTorque = 1,
    controlModeForce = 2
} control_mode_t;

typedef struct
{
    union
    {
        struct  // controlModeLegacy
        {
            int16_t roll, pitch, yaw;
            float   thrust;  ///< 0..65535
        };
        float normalizedForces[STABILIZER_NR_OF_MOTORS];  ///< controlModeForce: 0..1
    };
    control_mode_t controlMode;
} control_t;

#define RATE_1000_HZ   1000
#define RATE_500_HZ    500
#define RATE_250_HZ    250
#define RATE_MAIN_LOOP RATE_1000_HZ

#define RATE_DO_EXECUTE(rate_hz, step) (((step) % (RATE_MAIN_LOOP / (rate_hz))) == 0)
#endif  // SDK_STABILIZER_TYPES_H
