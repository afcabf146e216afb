// The flight core as a module of a C++ autopilot, in the shape of PX4: a work item that is run when a sample comes, reads topics, and
// writes motors.                                                                                       make example-cpp
//
// The topics here are plain structs with PX4's names, frames and units, so that the file compiles alone.  In PX4 they are uORB
// subscriptions, `Run` is called by a work queue at the rate of the gyro, and `motors` goes to actuator_motors.
#include <array>
#include <cmath>
#include <cstdio>
#include <optional>

#include "planar.h"  // includes ivl.h, which C++ can include as it is

namespace
{

// PX4: NED world (x north, y east, z down), FRD body (x forward, y right, z down), quaternion w x y z from body to world
struct VehicleLocalPosition
{
    uint64_t timestamp_sample;
    float    x, y, z, vx, vy, vz;
};
struct VehicleAttitude
{
    std::array<float, 4> q;
};
struct VehicleAngularVelocity
{
    std::array<float, 3> xyz;
};
struct SensorCombined
{
    std::array<float, 3> accelerometer_m_s2;
};
struct ActuatorMotors
{
    std::array<float, 4> control;  // 0 .. 1
};

// FRD and NED turn into the core's frames by half a turn about x: y and z change their signs, in vectors and in quaternions
ivl_vec3_t turned(float x, float y, float z)
{
    return {x, -y, -z};
}
ivl_quat_t turned(const std::array<float, 4> &q)
{
    return {q[1], -q[2], -q[3], q[0]};
}

class InvertedLanding
{
  public:
    explicit InvertedLanding(const ivl_cfg_t &cfg) : cfg_(cfg)
    {
        ivl_init(&cfg_, &state_);
    }

    bool setPolicy(float rrev_c_per_s, float moment_Nm)
    {
        ivl_policy_t policy{};
        policy.id.seq = ++n_policies_;
        policy.n = 2;
        policy.theta[0] = rrev_c_per_s;
        policy.theta[1] = moment_Nm;
        policy.id.crc = ivl_policy_crc(&policy);
        return ivl_policy_commit(&cfg_, &state_, &policy) == IVL_OK;
    }

    void command(const ivl_command_t &wanted)
    {
        in_.cmd = wanted;
    }

    // one sample in, four motors out; nothing while the core leaves the motors to the autopilot's own controllers
    std::optional<ActuatorMotors> Run(uint64_t now_us, const VehicleLocalPosition &position, const VehicleAttitude &attitude,
                                      const VehicleAngularVelocity &rate, const SensorCombined &imu)
    {
        in_.t_us = now_us;
        in_.t_pose_us = position.timestamp_sample;
        in_.p_WB_m = turned(position.x, position.y, position.z);
        in_.v_WB_mps = turned(position.vx, position.vy, position.vz);
        in_.q_WB = turned(attitude.q);
        in_.w_B_radps = turned(rate.xyz[0], rate.xyz[1], rate.xyz[2]);
        in_.f_B_mps2 = turned(imu.accelerometer_m_s2[0], imu.accelerometer_m_s2[1], imu.accelerometer_m_s2[2]);
        ivl_step(&cfg_, &state_, &in_, &out_);
        if (out_.stock_allowed)
        {
            return std::nullopt;
        }
        // PX4's quad X: front right, rear left, front left, rear right
        const float most = cfg_.motor_thrust_N_max;
        return ActuatorMotors{{out_.thrust_N[0] / most, out_.thrust_N[2] / most, out_.thrust_N[3] / most, out_.thrust_N[1] / most}};
    }

    const ivl_out_t &out() const
    {
        return out_;
    }
    const ivl_state_t &state() const
    {
        return state_;
    }

  private:
    ivl_cfg_t   cfg_;
    ivl_state_t state_{};
    ivl_in_t    in_{};
    ivl_out_t   out_{};
    uint32_t    n_policies_ = 0;
};

// the example's body as PX4 would see it
bool fly(InvertedLanding &module, const ivl_cfg_t &cfg)
{
    planar_t body{};
    body.z_m = 0.5f;
    body.fz_B_mps2 = cfg.gravity_mps2;
    for (uint32_t tick = 1; tick < 5000u && body.z_m < cfg.h_ceil_m - PLANAR_REACH_M; tick++)
    {
        const auto    now_us = static_cast<uint64_t>(1.0e6 * tick / static_cast<double>(cfg.tick_hz));
        ivl_command_t wanted{};
        wanted.request = tick < 250u ? IVL_REQUEST_HOVER : IVL_REQUEST_APPROACH;
        wanted.p_hover_W_m = {0.0f, 0.0f, 0.5f};
        wanted.speed_mps = 3.0f;
        wanted.angle_rad = 1.3089969f;  // 75 degrees
        module.command(wanted);
        const float half = 0.5f * body.pitch_rad;
        const auto  motors = module.Run(now_us, {now_us, body.x_m, 0.0f, -body.z_m, body.vx_mps, 0.0f, -body.vz_mps},
                                        {{std::cos(half), 0.0f, -std::sin(half), 0.0f}}, {{0.0f, -body.rate_radps, 0.0f}},
                                        {{body.fx_B_mps2, 0.0f, -body.fz_B_mps2}});
        float       thrust_N = 0.0f, moment_Nm = 0.0f;
        if (motors)
        {
            const auto &u = motors->control;
            const float most = cfg.motor_thrust_N_max;
            thrust_N = most * (u[0] + u[1] + u[2] + u[3]);
            moment_Nm = most * cfg.arm_x_m * (u[1] + u[3] - u[0] - u[2]);  // the front pair turns the nose up
        }
        planar_step(&cfg, &body, thrust_N, moment_Nm);
    }
    const float turned_deg = -57.29578f * body.pitch_rad;
    const auto &seen = module.state().snapshot;
    std::printf("flip at RREV %.2f 1/s; where legs touch turned by %.0f degrees, moving at %.2f m/s along it\n",
                static_cast<double>(seen.rrev_per_s), static_cast<double>(turned_deg), static_cast<double>(body.vx_mps));
    return module.state().triggered && seen.rrev_per_s >= 5.5f && seen.rrev_per_s < 5.7f && turned_deg > 90.0f && turned_deg < 220.0f;
}

}  // namespace

int main()
{
    ivl_cfg_t cfg;
    ivl_cfg_defaults(&cfg);
    cfg.h_ceil_m = 3.0f;
    InvertedLanding module(cfg);
    if (!module.setPolicy(5.5f, 8.0e-3f) || module.setPolicy(5.5f, 1.0f))  // the second is beyond what a policy may ask for
    {
        std::fprintf(stderr, "the core takes the wrong policy\n");
        return 1;
    }
    return fly(module, cfg) ? 0 : 1;
}
