/// @file test_sim_level_out.c
/// Commands near the ceiling, flown: whatever is asked for around the last moment and while the vehicle rises, no part of it touches the ceiling.
#include <string.h>

#include "policy_fixture.h"
#include "sim_fixture.h"
#include "world_rollout.h"

enum
{
    N_TICKS_MAX = 2500
};

/// What came of a flight.
typedef struct
{
    int         n_last;       ///< tick of the last moment
    double      clearance_m;  ///< least distance of any part of the vehicle from the ceiling
    bool        touched;
    ivl_phase_t phase;  ///< in the end
    double      p_W_m[3];
} flown_t;

static ivl_sim_model_t lagging_model(void)
{
    ivl_sim_params_t p = fixture_params();
    p.rotor_tau_down_s = 0.01;
    return fixture_model(&p);
}

/// An approach that the policy calls off.
static ivl_sim_spec_t called_off(double speed_mps, double angle_deg)
{
    const ivl_policy_t policy = no_go_policy(1);
    ivl_sim_spec_t     spec;
    memset(&spec, 0, sizeof spec);
    spec.speed_mps[0] = speed_mps;
    spec.angle_deg[0] = angle_deg;
    spec.start[0] = IVL_SIM_START_FLOWN;
    spec.form[0] = (int32_t)policy.id.form;
    spec.seed[0] = 3;
    for (uint32_t i = 0; i < policy.n; i++)
    {
        spec.theta[i] = (double)policy.theta[i];
    }
    // the last moment decides, and not the threshold
    spec.theta[0] = 20.0;
    return spec;
}

static double clearance(const ivl_sim_model_t *model, const ivl_sim_kin_t *kin)
{
    const ivl_rot_t R = ivl_rot_from_quat(kin->q_WB);
    const ivl_d3_t  normal = ivl_rot_apply_inverse(&R, model->surface.normal_W);
    const double    height = ivl_sim_surface_height_of(&model->surface, ivl_d3_load(kin->p_WB_m));
    double          top = height;
    for (int i = 0; i < IVL_SIM_PLATES; i++)
    {
        top = fmax(top, height + ivl_sim_plate_top(&model->plate[i], normal));
    }
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        top = fmax(top, ivl_sim_surface_height_of(&model->surface, ivl_d3_load(kin->p_foot_W_m[i])) + model->raw.leg_foot_radius_m);
    }
    return ivl_sim_surface_height(&model->surface, 0.0) - top;
}

/// One flight; from tick n_asked on a command is there.
static flown_t fly(const ivl_sim_model_t *model, const ivl_sim_spec_t *spec, int n_asked, const ivl_command_t *cmd)
{
    static ivl_sim_group_t group;
    flown_t                flown = {.n_last = -1, .clearance_m = 1.0e9};
    ivl_sim_group_init(model, &group);
    group.port = model->core.open(model->core.context);
    TEST_ASSERT_TRUE(ivl_sim_rollout_start(&group, 0, spec));
    ivl_sim_world_t *world = &group.world[0];
    for (int n = 0; n < N_TICKS_MAX; n++)
    {
        world->in.cmd = (n >= n_asked) ? *cmd : world->in.cmd;
        ivl_sim_world_tick(&group, 0);
        flown.n_last = (world->firmware.phase == IVL_PHASE_LEVEL_OUT && flown.n_last < 0) ? n : flown.n_last;
        do
        {
            ivl_sim_group_step(&group);
        } while (!ivl_sim_world_ready(&group, 0));
        const ivl_sim_kin_t kin = ivl_sim_world_kin(&group, 0);
        flown.clearance_m = fmin(flown.clearance_m, clearance(model, &kin));
        memcpy(flown.p_W_m, kin.p_WB_m, sizeof flown.p_W_m);
    }
    flown.touched = world->impact.happened;
    flown.phase = world->firmware.phase;
    model->core.close(group.port);
    return flown;
}

// HOVER at so far from where the level-out comes to rest, or ABORT
static const float ASIDE_M[][3] = {{-0.5f, 0.3f, 0.1f}, {0.4f, 0.0f, 0.0f}};

enum
{
    N_ASKED = 3
};

static ivl_command_t asked(int k, const double p_W_m[3])
{
    if (k == 2)
    {
        return (ivl_command_t){.request = IVL_REQUEST_ABORT};
    }
    const float *aside_m = ASIDE_M[k];
    return (ivl_command_t){
        .request = IVL_REQUEST_HOVER,
        .p_hover_W_m = {(float)p_W_m[0] + aside_m[0], (float)p_W_m[1] + aside_m[1], (float)p_W_m[2] + aside_m[2]},
    };
}

static const double APPROACHES[][2] = {{1.0, 90.0}, {2.5, 45.0}, {3.5, 30.0}, {3.5, 60.0}};

// ticks after the last moment: before it, at it, twice in the rise, which takes 40 to 130 ticks, and near its top
static const int AFTER[] = {-3, 0, 1, 20, 60};

static void test_nothing_that_is_asked_for_near_the_ceiling_brings_a_vehicle_closer_to_it_than_its_level_out(void)
{
    const ivl_sim_model_t model = lagging_model();
    for (size_t i = 0; i < sizeof APPROACHES / sizeof APPROACHES[0]; i++)
    {
        const ivl_sim_spec_t spec = called_off(APPROACHES[i][0], APPROACHES[i][1]);
        const ivl_command_t  none = {.request = IVL_REQUEST_APPROACH};
        const flown_t        alone = fly(&model, &spec, N_TICKS_MAX, &none);
        TEST_ASSERT_TRUE(alone.n_last > 0 && !alone.touched);
        TEST_ASSERT_EQUAL_INT(IVL_PHASE_LEVEL_OUT, alone.phase);
        for (int k = 0; k < N_ASKED; k++)
        {
            for (size_t a = 0; a < sizeof AFTER / sizeof AFTER[0]; a++)
            {
                const ivl_command_t cmd = asked(k, alone.p_W_m);
                const flown_t       flown = fly(&model, &spec, alone.n_last + AFTER[a], &cmd);
                TEST_ASSERT_FALSE(flown.touched);
                TEST_ASSERT_TRUE(flown.clearance_m > alone.clearance_m - 1.0e-3);
                const bool hovers = cmd.request == IVL_REQUEST_HOVER;
                TEST_ASSERT_EQUAL_INT(hovers ? IVL_PHASE_READY : IVL_PHASE_ABORTED, flown.phase);
                TEST_ASSERT_TRUE(!hovers || fabs(flown.p_W_m[2] - (double)cmd.p_hover_W_m.z) < 0.05);
            }
        }
    }
}

void setUp(void)
{
}

void tearDown(void)
{
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_nothing_that_is_asked_for_near_the_ceiling_brings_a_vehicle_closer_to_it_than_its_level_out);
    return UNITY_END();
}
