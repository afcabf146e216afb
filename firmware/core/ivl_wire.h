/// @file ivl_wire.h
/// Packets of the app channel, written once for vehicle, simulator and host.
/// A packet is at most 30 bytes: type (u8), version (u8), then the members of its table in order, little-endian, without padding.
/// A member row is X(type, name, unit, doc).  docs/FIRMWARE.md shows the same tables.
#ifndef IVL_WIRE_H
#define IVL_WIRE_H
#include "ivl_types.h"

#define IVL_WIRE_VERSION  2u
#define IVL_WIRE_SIZE_MAX 30u
#define IVL_WIRE_THETAS   4u  ///< parameters of a policy in one packet

/// Names of the member types in the tables below.
typedef uint8_t  ivl_u8_t;
typedef uint16_t ivl_u16_t;
typedef uint32_t ivl_u32_t;
typedef int8_t   ivl_i8_t;
typedef int16_t  ivl_i16_t;
typedef float    ivl_f32_t;

// clang-format off
/// Host to vehicle, type 0x01: a part of a policy, which is put in force when all of its parts have come.
#define IVL_WIRE_POLICY(X)                                                       \
    X(u32, seq, "1", "number given by the host")                                 \
    X(u32, crc, "1", "of the whole policy: ivl_policy_crc")                      \
    X(u8, form, "1", "row of IVL_FORMS")                                         \
    X(u8, n, "1", "parameters of the policy")                                    \
    X(u8, part, "1", "this is number `part` of n / 4 parts, rounded up, from 0") \
    X(f32, theta0, "SI", "parameter 4 part")                                     \
    X(f32, theta1, "SI", "the next one; 0 if there is none")                     \
    X(f32, theta2, "SI", "the next one; 0 if there is none")                     \
    X(f32, theta3, "SI", "the next one; 0 if there is none")

/// Host to vehicle, type 0x02: what the operator wants; repeated, it is the heartbeat.
#define IVL_WIRE_COMMAND(X)                                                      \
    X(u16, seq, "1", "number given by the host")                                 \
    X(u8, request, "1", "ivl_request_t")                                         \
    X(f32, hover_x_m, "m", "used by HOVER")                                      \
    X(f32, hover_y_m, "m", "used by HOVER")                                      \
    X(f32, hover_z_m, "m", "used by HOVER")                                      \
    X(f32, speed_mps, "m/s", "used by APPROACH")                                 \
    X(f32, angle_rad, "rad", "used by APPROACH: above the horizontal")

/// Camera to vehicle, type 0x03: what it saw of the ceiling.  Not answered.
#define IVL_WIRE_READING(X)                                                      \
    X(u8, valid, "1", "sum of 1: rrev_per_s holds, 2: of_y_radps holds")         \
    X(f32, age_s, "s", "from the sampling instant to sending")                   \
    X(f32, rrev_per_s, "1/s", "positive while the ceiling comes closer")         \
    X(f32, of_y_radps, "rad/s", "OF_y, without the body's rotation")

/// Vehicle to host, type 0x81: answer to the last part of 0x01, or to the one that made it whole, with what is in force after it.
#define IVL_WIRE_POLICY_ECHO(X)                                                  \
    X(u32, seq, "1", "number of the packet that is answered")                    \
    X(i8, status, "1", "ivl_wire_status_t")                                      \
    X(u16, missing, "1", "ERR_INCOMPLETE: bit i is set if part i has not come")  \
    X(u32, seq_in_force, "1", "number of the policy in force, 0 if none is")     \
    X(u32, crc_in_force, "1", "its checksum")                                    \
    X(u8, form_in_force, "1", "its form")

/// Vehicle to host, type 0x82: answer to 0x02.
#define IVL_WIRE_COMMAND_ECHO(X)                                                 \
    X(u16, seq, "1", "number of the packet that is answered")                    \
    X(i8, status, "1", "ivl_wire_status_t")                                      \
    X(u8, request, "1", "request in force")                                      \
    X(u8, phase, "1", "ivl_phase_t")                                             \
    X(u8, rule, "1", "ivl_rule_t that holds now")                                \
    X(u8, cause, "1", "ivl_rule_t that last ended a phase of this cycle")

/// Vehicle to host, type 0x83: answer to a write of the parameter ivl.commit.
#define IVL_WIRE_CONFIG_ECHO(X)                                                  \
    X(u32, seq, "1", "value that was written")                                   \
    X(i8, status, "1", "ivl_wire_status_t")                                      \
    X(u8, bad, "1", "row of IVL_PARAMS that was refused, 255 if none was")       \
    X(u32, crc, "1", "CRC-32 of the configuration in force")
// clang-format on

typedef enum
{
    IVL_WIRE_TYPE_POLICY = 0x01,
    IVL_WIRE_TYPE_COMMAND = 0x02,
    IVL_WIRE_TYPE_READING = 0x03,
    IVL_WIRE_TYPE_POLICY_ECHO = 0x81,
    IVL_WIRE_TYPE_COMMAND_ECHO = 0x82,
    IVL_WIRE_TYPE_CONFIG_ECHO = 0x83
} ivl_wire_type_t;

/// Bits of a reading's member `valid`.
typedef enum
{
    IVL_WIRE_VALID_RREV = 1,
    IVL_WIRE_VALID_FLOW = 2
} ivl_wire_valid_t;

/// Status of an echo: ivl_status_t, and what only a port can say.
typedef enum
{
    IVL_WIRE_OK = IVL_OK,
    IVL_WIRE_ERR_RANGE = IVL_ERR_RANGE,
    IVL_WIRE_ERR_PHASE = IVL_ERR_PHASE,
    IVL_WIRE_ERR_NO_CONTROLLER = -3,  ///< the core does not run: another controller is selected
    IVL_WIRE_ERR_FORM = IVL_ERR_FORM,
    IVL_WIRE_ERR_CRC = -5,        ///< the parts of a policy do not have the checksum that they state: nothing is in force of it
    IVL_WIRE_ERR_INCOMPLETE = -6  ///< parts of the policy have not come
} ivl_wire_status_t;

#define IVL_WIRE_MEMBER(type, name, unit, doc) ivl_##type##_t name;
typedef struct
{
    IVL_WIRE_POLICY(IVL_WIRE_MEMBER)
} ivl_wire_policy_t;
typedef struct
{
    IVL_WIRE_COMMAND(IVL_WIRE_MEMBER)
} ivl_wire_command_t;
typedef struct
{
    IVL_WIRE_READING(IVL_WIRE_MEMBER)
} ivl_wire_reading_t;
typedef struct
{
    IVL_WIRE_POLICY_ECHO(IVL_WIRE_MEMBER)
} ivl_wire_policy_echo_t;
typedef struct
{
    IVL_WIRE_COMMAND_ECHO(IVL_WIRE_MEMBER)
} ivl_wire_command_echo_t;
typedef struct
{
    IVL_WIRE_CONFIG_ECHO(IVL_WIRE_MEMBER)
} ivl_wire_config_echo_t;

/// Write a packet.
/// @param[out] bytes  at least IVL_WIRE_SIZE_MAX
/// @return its size
size_t ivl_wire_put_policy(uint8_t *bytes, const ivl_wire_policy_t *packet);
size_t ivl_wire_put_command(uint8_t *bytes, const ivl_wire_command_t *packet);
size_t ivl_wire_put_reading(uint8_t *bytes, const ivl_wire_reading_t *packet);
size_t ivl_wire_put_policy_echo(uint8_t *bytes, const ivl_wire_policy_echo_t *packet);
size_t ivl_wire_put_command_echo(uint8_t *bytes, const ivl_wire_command_echo_t *packet);
size_t ivl_wire_put_config_echo(uint8_t *bytes, const ivl_wire_config_echo_t *packet);

/// Read a packet.  Values are passed on as they come, numbers or not: their ranges are checked where they are put in force.
/// @return false, and *packet unchanged, unless type, version and size are right
bool ivl_wire_get_policy(const uint8_t *bytes, size_t size, ivl_wire_policy_t *packet);
bool ivl_wire_get_command(const uint8_t *bytes, size_t size, ivl_wire_command_t *packet);
bool ivl_wire_get_reading(const uint8_t *bytes, size_t size, ivl_wire_reading_t *packet);
bool ivl_wire_get_policy_echo(const uint8_t *bytes, size_t size, ivl_wire_policy_echo_t *packet);
bool ivl_wire_get_command_echo(const uint8_t *bytes, size_t size, ivl_wire_command_echo_t *packet);
bool ivl_wire_get_config_echo(const uint8_t *bytes, size_t size, ivl_wire_config_echo_t *packet);

/// A float in four bytes, little-endian.
void ivl_wire_put_f32(uint8_t *bytes, float value);

/// CRC-32 (reflected, polynomial 0xEDB88320, as in zip files) of bytes that follow those behind `crc`; start with crc 0.
uint32_t ivl_wire_crc(uint32_t crc, const void *data, size_t size);
#endif  // IVL_WIRE_H
