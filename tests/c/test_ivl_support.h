/// @file test_ivl_support.h
/// Shared by the tests of the firmware core: seeded random numbers, a vehicle whose inputs are set by hand, and ways to spoil an input.
#ifndef TEST_IVL_SUPPORT_H
#define TEST_IVL_SUPPORT_H
#include <float.h>
#include <math.h>
#include <string.h>

#include "ivl.h"
#include "policy_fixture.h"
#include "unity.h"

// ---- random numbers: splitmix64, same sequence on every machine

typedef struct
{
    uint64_t state;
} rng_t;

static inline uint64_t rng_u64(rng_t *rng)
{
    rng->state += 0x9e3779b97f4a7c15u;
    uint64_t z = rng->state;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

static inline uint32_t rng_below(rng_t *rng, uint32_t n)
{
    return (uint32_t)((rng_u64(rng) >> 32) % n);
}

/// Uniform in [lo, hi).
static inline float rng_float(rng_t *rng, float lo, float hi)
{
    return lo + (hi - lo) * (float)(rng_u64(rng) >> 40) * (1.0f / 16777216.0f);
}

static inline ivl_vec3_t rng_vec3(rng_t *rng, float limit)
{
    const float x = rng_float(rng, -limit, limit);
    const float y = rng_float(rng, -limit, limit);
    return ivl_vec3(x, y, rng_float(rng, -limit, limit));
}

static inline ivl_quat_t rng_quat(rng_t *rng)
{
    for (;;)
    {
        const ivl_vec3_t v = rng_vec3(rng, 1.0f);
        const float      w = rng_float(rng, -1.0f, 1.0f);
        const float      n2 = ivl_dot(v, v) + w * w;
        if ((n2 > 0.01f) && (n2 < 1.0f))
        {
            const float k = 1.0f / sqrtf(n2);
            return (ivl_quat_t){v.x * k, v.y * k, v.z * k, w * k};
        }
    }
}

// ---- stages that are fed by hand

/// What the surface stage makes of the sample.
static inline void see(const ivl_cfg_t *cfg, ivl_sense_t *sense)
{
    ivl_surface_t surface;
    ivl_surface_init(cfg, &surface);
    ivl_surface_see(cfg, &surface, &sense->sample, &sense->rel);
}

// ---- a core with its four structs

typedef struct
{
    ivl_cfg_t   cfg;
    ivl_state_t state;
    ivl_in_t    in;
    ivl_out_t   out;
} fix_t;

/// Level, at rest, 1.1 m below the ceiling, request IDLE.
static inline ivl_in_t good_input(void)
{
    return (ivl_in_t){.p_WB_m = {0.0f, 0.0f, 1.0f},
                      .q_WB = {0.0f, 0.0f, 0.0f, 1.0f},
                      .f_B_mps2 = {0.0f, 0.0f, 9.81f},
                      .cmd = {.p_hover_W_m = {0.0f, 0.0f, 1.0f}, .speed_mps = 2.5f, .angle_rad = 1.2f}};
}

/// Of a vehicle that may fly.
static inline ivl_vitals_t good_vitals(void)
{
    return (ivl_vitals_t){.given = true, .configured = true, .can_fly = true, .stock_idle = true, .vbat_V = 4.0f};
}

static inline void fix_init(fix_t *fix)
{
    memset(fix, 0, sizeof *fix);
    ivl_cfg_defaults(&fix->cfg);
    ivl_init(&fix->cfg, &fix->state);
    fix->in = good_input();
}

static inline void fix_policy(fix_t *fix, float rrev_c_per_s, float moment_Nm)
{
    const ivl_policy_t policy = constant_policy(7, rrev_c_per_s, moment_Nm);
    TEST_ASSERT_EQUAL_INT(IVL_OK, ivl_policy_commit(&fix->cfg, &fix->state, &policy));
}

/// Advance the clock by one tick, keep the age of the pose, and step.
static inline void fix_tick(fix_t *fix)
{
    const uint64_t period_us = (uint64_t)(1.0e6f / fix->cfg.tick_hz);
    fix->in.t_us += period_us;
    fix->in.t_pose_us += period_us;
    ivl_step(&fix->cfg, &fix->state, &fix->in, &fix->out);
}

static inline void fix_ticks(fix_t *fix, float duration_s)
{
    const int n = (int)(duration_s * fix->cfg.tick_hz + 0.5f);
    for (int i = 0; i < n; i++)
    {
        fix_tick(fix);
    }
}

static inline void fix_request(fix_t *fix, ivl_request_t request)
{
    fix->in.cmd.request = request;
    fix_tick(fix);
}

/// Bring a fresh core with defaults into a phase; its last input is good and would not leave the phase in the next tick.
static inline void fix_to_phase(fix_t *fix, ivl_phase_t phase)
{
    fix_init(fix);
    fix_policy(fix, 4.0f, 0.008f);
    fix_tick(fix);
    if (phase == IVL_PHASE_IDLE)
    {
        return;
    }
    fix_request(fix, IVL_REQUEST_HOVER);
    if (phase == IVL_PHASE_ABORTED)
    {
        fix_request(fix, IVL_REQUEST_ABORT);
    }
    if ((phase == IVL_PHASE_READY) || (phase == IVL_PHASE_ABORTED))
    {
        return;
    }
    if (phase == IVL_PHASE_LEVEL_OUT)
    {
        const ivl_policy_t policy = no_go_policy(8);
        TEST_ASSERT_EQUAL_INT(IVL_OK, ivl_policy_commit(&fix->cfg, &fix->state, &policy));
    }
    fix_request(fix, IVL_REQUEST_APPROACH);
    if (phase == IVL_PHASE_APPROACH)
    {
        return;
    }
    // closing at 2.5 m/s, 0.5 m below the ceiling: RREV = 5
    fix->in.v_WB_mps.z = 2.5f;
    fix->in.p_WB_m.z = 1.6f;
    fix_tick(fix);
    if (phase == IVL_PHASE_LEVEL_OUT)
    {
        return;
    }
    if (phase == IVL_PHASE_FLIP)
    {
        return;
    }
    // upside down, free fall
    fix->in.q_WB = (ivl_quat_t){0.0f, 1.0f, 0.0f, 0.0f};
    fix->in.f_B_mps2 = ivl_vec3(0.0f, 0.0f, 0.0f);
    fix_tick(fix);
    if (phase == IVL_PHASE_COAST)
    {
        return;
    }
    // an impact, then hanging
    fix->in.f_B_mps2.x = 60.0f;
    fix_tick(fix);
    fix->in.f_B_mps2 = ivl_vec3(0.0f, 0.0f, -9.81f);
    if (phase == IVL_PHASE_DONE)
    {
        fix_ticks(fix, fix->cfg.attached_s + 0.1f);
    }
}

// ---- what must hold after every tick

static inline void assert_output_sane(const fix_t *fix)
{
    for (int i = 0; i < 4; i++)
    {
        TEST_ASSERT_TRUE(isfinite(fix->out.thrust_N[i]));
        TEST_ASSERT_TRUE(fix->out.thrust_N[i] >= 0.0f);
        TEST_ASSERT_TRUE(fix->out.thrust_N[i] <= fix->cfg.motor_thrust_N_max);
        TEST_ASSERT_TRUE((float)fix->out.pwm[i] <= fix->cfg.pwm_max);
        TEST_ASSERT_TRUE(fix->out.motors_on || !(fix->out.thrust_N[i] > 0.0f));
        TEST_ASSERT_TRUE(fix->out.motors_on || (fix->out.pwm[i] == 0u));
    }
    const ivl_phase_t phase = fix->out.phase;
    const bool        may_run = (phase == IVL_PHASE_READY) || (phase == IVL_PHASE_APPROACH) || (phase == IVL_PHASE_FLIP) ||
                                (phase == IVL_PHASE_ABORTED) || (phase == IVL_PHASE_LEVEL_OUT);
    TEST_ASSERT_TRUE(may_run || !fix->out.motors_on);
}

static inline void assert_motors_off(const fix_t *fix)
{
    assert_output_sane(fix);
    TEST_ASSERT_FALSE(fix->out.motors_on);
}

// the vehicle's build has no names
static inline const char *phase_text(ivl_phase_t phase)
{
#ifdef IVL_NO_TEXT
    (void)phase;
    return "phase";
#else
    return ivl_phase_name(phase);
#endif
}

static inline void assert_phase(ivl_phase_t expected, const fix_t *fix)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(expected, fix->out.phase, phase_text(fix->out.phase));
}

// ---- spoiled inputs

#define SPOIL_FLOATS 16  ///< p, v, q, w, f
#define SPOIL_VALUES 7
#define SPOIL_COUNT  (SPOIL_FLOATS * SPOIL_VALUES + 7)

static inline float *spoil_float(ivl_in_t *in, uint32_t i)
{
    float *const fields[SPOIL_FLOATS] = {
        &in->p_WB_m.x,    &in->p_WB_m.y,   &in->p_WB_m.z,   &in->v_WB_mps.x, &in->v_WB_mps.y,  &in->v_WB_mps.z,
        &in->q_WB.x,      &in->q_WB.y,     &in->q_WB.z,     &in->q_WB.w,     &in->w_B_radps.x, &in->w_B_radps.y,
        &in->w_B_radps.z, &in->f_B_mps2.x, &in->f_B_mps2.y, &in->f_B_mps2.z,
    };
    return fields[i];
}

/// True if spoil() of this kind makes the command unacceptable, false if it is the sensed state.
static inline bool spoils_command(uint32_t kind)
{
    return kind >= SPOIL_FLOATS * SPOIL_VALUES + 4;
}

/// Spoil one field so that sensed state or command is not acceptable, whatever the request (kinds 0 .. SPOIL_COUNT - 1).
static inline void spoil(ivl_in_t *in, uint32_t kind)
{
    const float values[SPOIL_VALUES] = {NAN, -NAN, INFINITY, -INFINITY, FLT_MAX, -FLT_MAX, 1.0e9f};
    if (kind < SPOIL_FLOATS * SPOIL_VALUES)
    {
        *spoil_float(in, kind / SPOIL_VALUES) = values[kind % SPOIL_VALUES];
        return;
    }
    switch (kind - SPOIL_FLOATS * SPOIL_VALUES)
    {
    case 0:  // a pose from the future
        in->t_pose_us = in->t_us + 1u;
        break;
    case 1:  // a pose from before the flood
        in->t_pose_us = in->t_us - 3600000000u;
        break;
    case 2:
        in->q_WB = (ivl_quat_t){0.0f, 0.0f, 0.0f, 0.0f};
        break;
    case 3:
        in->q_WB = (ivl_quat_t){1.0f, 1.0f, 1.0f, 1.0f};
        break;
    case 4:  // no such request
        in->cmd.request = IVL_REQUEST_COUNT;
        break;
    case 5:
        in->cmd.request = (ivl_request_t)0x5a5a5a5a;
        break;
    default:  // a command whose arguments are no numbers; IDLE and ABORT have none and stay good, so make it an approach
        in->cmd = (ivl_command_t){.request = IVL_REQUEST_APPROACH, .speed_mps = NAN, .angle_rad = NAN};
        break;
    }
}
#endif  // TEST_IVL_SUPPORT_H
