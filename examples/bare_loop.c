/// @file bare_loop.c
/// The flight core in a bare loop: nothing but C11, a body to fly, and the calls in their order.     make example-cpp
#include <stdio.h>

#include "planar.h"

/// The paper's form: flip when RREV passes 5 1/s, with 8 N mm.
static ivl_policy_t policy(void)
{
    ivl_policy_t chosen = {.id = {.seq = 1, .form = 0}, .n = 2, .theta = {5.0f, 8.0e-3f}};
    chosen.id.crc = ivl_policy_crc(&chosen);
    return chosen;
}

int main(void)
{
    ivl_cfg_t cfg;
    ivl_cfg_defaults(&cfg);  // a Crazyflie; then change what differs on your vehicle
    cfg.h_ceil_m = 3.0f;
    ivl_state_t state;
    ivl_init(&cfg, &state);
    const ivl_policy_t chosen = policy();
    if (ivl_cfg_check(&cfg) != IVL_OK || ivl_policy_commit(&cfg, &state, &chosen) != IVL_OK)
    {
        fprintf(stderr, "the core refuses configuration or policy\n");
        return 1;
    }

    planar_t    body = {.z_m = 0.5f, .fz_B_mps2 = cfg.gravity_mps2};
    ivl_in_t    in = {.q_WB = {.w = 1.0f}};
    ivl_out_t   out = {.phase = IVL_PHASE_IDLE};
    ivl_phase_t before = IVL_PHASE_COUNT;
    for (uint32_t tick = 1; tick < 5000u && body.z_m < cfg.h_ceil_m - PLANAR_REACH_M; tick++)
    {
        planar_sense(&body, (uint64_t)((double)tick * 1.0e6 / (double)cfg.tick_hz), &in);
        in.cmd.request = (tick < 250u) ? IVL_REQUEST_HOVER : IVL_REQUEST_APPROACH;  // half a second in hover, then go
        in.cmd.p_hover_W_m = (ivl_vec3_t){0.0f, 0.0f, 0.5f};
        in.cmd.speed_mps = 2.5f;
        in.cmd.angle_rad = 1.5707963f;  // straight up
        ivl_step(&cfg, &state, &in, &out);
        planar_step(&cfg, &body, out.thrust_total_N, out.pitch_moment_Nm);
        if (out.phase != before)
        {
            printf("%5.3f s: phase %d at %.2f m below the ceiling\n", (double)tick / (double)cfg.tick_hz, (int)out.phase,
                   (double)(cfg.h_ceil_m - body.z_m));
            before = out.phase;
        }
    }
    const float turned_deg = -57.29578f * body.pitch_rad;
    printf("flip at RREV %.2f 1/s; where legs touch turned by %.0f degrees, rising at %.2f m/s\n", (double)state.snapshot.rrev_per_s,
           (double)turned_deg, (double)body.vz_mps);
    // it must have flipped where the policy says, within a tick of RREV, and have come up with the feet ahead
    const bool at_policy = state.triggered && state.snapshot.rrev_per_s >= 5.0f && state.snapshot.rrev_per_s < 5.2f;
    return (at_policy && turned_deg > 90.0f && turned_deg < 220.0f) ? 0 : 1;
}
