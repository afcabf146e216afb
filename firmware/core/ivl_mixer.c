/// @file ivl_mixer.c
/// Thrust f at (x, y) makes the moment (y f, -x f) in B; rotors M2, M4 push yaw one way, M1, M3 the other:
///   T  = f1 + f2 + f3 + f4            M_x = arm_y (-f1 - f2 + f3 + f4)
///   M_y = arm_x (-f1 + f2 + f3 - f4)  M_z = c (-f1 + f2 - f3 + f4)
/// The four rows are orthogonal, so the inverse is the transpose with a quarter of each row.
#include "ivl_mixer.h"

// signs of roll, pitch and yaw of M1..M4
static const float ROLL_SIGN[4] = {-1.0f, -1.0f, 1.0f, 1.0f};
static const float PITCH_SIGN[4] = {-1.0f, 1.0f, 1.0f, -1.0f};
static const float YAW_SIGN[4] = {-1.0f, 1.0f, -1.0f, 1.0f};

// largest yaw share, up to |yaw|, that keeps every motor within [0, max]
static ivl_num_t yaw_that_fits(const ivl_num_t base_N[4], ivl_num_t yaw_N, float max_N)
{
    ivl_num_t fits_N = ivl_magnitude(yaw_N);
    for (int i = 0; i < 4; i++)
    {
        const ivl_num_t room_N = ivl_pick(YAW_SIGN[i] * yaw_N > 0.0f, max_N - base_N[i], base_N[i]);
        fits_N = ivl_pick(room_N < fits_N, room_N, fits_N);
    }
    return ivl_pick(yaw_N < 0.0f, -fits_N, fits_N);
}

void ivl_mixer_thrusts(const ivl_cfg_t *cfg, const ivl_wrench_t *wrench, ivl_num_t thrust_N[4])
{
    // shares of one motor
    const float     max_N = cfg->motor_thrust_N_max;
    const ivl_num_t none_N = ivl_num(0.0f), all_N = ivl_num(max_N);
    const ivl_num_t roll_N = 0.25f * wrench->moment_B_Nm.x / cfg->arm_y_m;
    const ivl_num_t pitch_N = 0.25f * wrench->moment_B_Nm.y / cfg->arm_x_m;
    const ivl_num_t yaw_N = 0.25f * wrench->moment_B_Nm.z / cfg->torque_per_thrust_m;
    const ivl_num_t spread_N = ivl_magnitude(roll_N) + ivl_magnitude(pitch_N);

    // collective: gives way at the upper end only, and not below the middle, where the room for roll and pitch is largest
    const ivl_num_t asked_N = ivl_clamp(0.25f * wrench->thrust_N, none_N, all_N);
    const ivl_num_t yielding_N = ivl_clamp(max_N - spread_N, ivl_num(0.5f * max_N), all_N);
    const ivl_num_t each_N = ivl_pick(asked_N < yielding_N, asked_N, yielding_N);

    // roll and pitch: scaled together into the room that is left
    const ivl_num_t room_N = ivl_pick(each_N < max_N - each_N, each_N, max_N - each_N);
    const ivl_num_t keep = ivl_pick(spread_N > room_N, room_N / spread_N, ivl_num(1.0f));

    ivl_num_t base_N[4];
    for (int i = 0; i < 4; i++)
    {
        base_N[i] = each_N + keep * (ROLL_SIGN[i] * roll_N + PITCH_SIGN[i] * pitch_N);
    }
    // yaw: what still fits; the limits only catch rounding and values that are no numbers
    const ivl_num_t yaw_fit_N = yaw_that_fits(base_N, yaw_N, max_N);
    for (int i = 0; i < 4; i++)
    {
        thrust_N[i] = ivl_clamp(base_N[i] + YAW_SIGN[i] * yaw_fit_N, none_N, all_N);
    }
}

ivl_wrench_t ivl_mixer_wrench(const ivl_cfg_t *cfg, const ivl_num_t thrust_N[4])
{
    const ivl_num_t f1 = thrust_N[0], f2 = thrust_N[1], f3 = thrust_N[2], f4 = thrust_N[3];
    return (ivl_wrench_t){
        .thrust_N = f1 + f2 + f3 + f4,
        .moment_B_Nm = {cfg->arm_y_m * (f3 + f4 - f1 - f2), cfg->arm_x_m * (f2 + f3 - f1 - f4),
                        cfg->torque_per_thrust_m * (f2 + f4 - f1 - f3)},
    };
}
