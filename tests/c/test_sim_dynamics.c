/// @file test_sim_dynamics.c
/// The lean equations of the simulator against a naive reference: every body and every rod with its own six coordinates,
/// Newton and Euler for each, joints and held feet as constraints, one dense system (Karush-Kuhn-Tucker) for all.

#include "sim_fixture.h"

// ---- the reference ---------------------------------------------------------------------------------------------------

enum
{
    N_Q = 6 + 4 * 9,  // body, and for each leg: rod centre, rod turn, foot
    N_C_MAX = 4 * 9,  // for each leg: hip, rod end at the foot, foot on the ceiling
    N_MAX = N_Q + N_C_MAX
};

// The simulator gives rods this compliance, m/(N s^2).  The reference has it as a slip of the hip along the rod: the two
// differ by that slip times the mass of a leg, a relative 1e-6.
static const double COMPLIANCE = 1.0e-3;
static const double AGREEMENT = 3.0e-6;

typedef struct
{
    double a[N_MAX][N_MAX], b[N_MAX], x[N_MAX];
    int    n, n_c, row_of_hip[4], row_of_ceiling[4];
    double v[N_Q];  // velocities of all parts
} reference_t;

/// Gaussian elimination with partial pivoting, in place.
static void solve(reference_t *r)
{
    for (int p = 0; p < r->n; p++)
    {
        int best = p;
        for (int i = p + 1; i < r->n; i++)
        {
            best = (fabs(r->a[i][p]) > fabs(r->a[best][p])) ? i : best;
        }
        for (int j = 0; j < r->n; j++)
        {
            const double swap = r->a[p][j];
            r->a[p][j] = r->a[best][j];
            r->a[best][j] = swap;
        }
        const double swap = r->b[p];
        r->b[p] = r->b[best];
        r->b[best] = swap;
        TEST_ASSERT_TRUE(fabs(r->a[p][p]) > 1.0e-12);
        for (int i = p + 1; i < r->n; i++)
        {
            const double f = r->a[i][p] / r->a[p][p];
            for (int j = p; j < r->n; j++)
            {
                r->a[i][j] -= f * r->a[p][j];
            }
            r->b[i] -= f * r->b[p];
        }
    }
    for (int i = r->n - 1; i >= 0; i--)
    {
        r->x[i] = r->b[i];
        for (int j = i + 1; j < r->n; j++)
        {
            r->x[i] -= r->a[i][j] * r->x[j];
        }
        r->x[i] /= r->a[i][i];
    }
}

static double component(ivl_d3_t v, int axis)
{
    return (axis == 0) ? v.x : ((axis == 1) ? v.y : v.z);
}

static ivl_d3_t axis_vector(int axis)
{
    return ivl_d3(axis == 0 ? 1.0 : 0.0, axis == 1 ? 1.0 : 0.0, axis == 2 ? 1.0 : 0.0);
}

static void set_inertia(reference_t *r, int at, const double inertia[3][3])
{
    for (int i = 0; i < 3; i++)
    {
        for (int j = 0; j < 3; j++)
        {
            r->a[at + i][at + j] = inertia[i][j];
        }
    }
}

/// I = moment (1 - n n^T) + axial n n^T; a thin rod has no axial moment, any value gives the same motion of its axis.
static void rod_inertia(double moment, ivl_d3_t n, double inertia[3][3])
{
    for (int i = 0; i < 3; i++)
    {
        for (int j = 0; j < 3; j++)
        {
            inertia[i][j] = ((i == j) ? moment : 0.0) - 0.5 * moment * component(n, i) * component(n, j);
        }
    }
}

static void body_inertia(const ivl_sim_params_t *raw, const ivl_rot_t *R, double inertia[3][3])
{
    const double own[3] = {raw->body_inertia_xx_kgm2, raw->body_inertia_yy_kgm2, raw->body_inertia_zz_kgm2};
    for (int i = 0; i < 3; i++)
    {
        for (int j = 0; j < 3; j++)
        {
            inertia[i][j] = 0.0;
            for (int k = 0; k < 3; k++)
            {
                inertia[i][j] += component(R->row[i], k) * own[k] * component(R->row[j], k);
            }
        }
    }
}

static ivl_d3_t times(const double m[3][3], ivl_d3_t v)
{
    return ivl_d3(m[0][0] * v.x + m[0][1] * v.y + m[0][2] * v.z, m[1][0] * v.x + m[1][1] * v.y + m[1][2] * v.z,
                  m[2][0] * v.x + m[2][1] * v.y + m[2][2] * v.z);
}

static void add_force(reference_t *r, int at, ivl_d3_t force)
{
    r->b[at] += force.x;
    r->b[at + 1] += force.y;
    r->b[at + 2] += force.z;
}

static ivl_d3_t velocity(const reference_t *r, int at)
{
    return ivl_d3_load(&r->v[at]);
}

/// A constraint  along . (acceleration of a point of one part - that of a point of another) = -(what is known of it).
/// A part is a block of coordinates; a turning part has its angular ones at `turn` (-1 for a point mass) and the point at
/// `arm` from its centre.
typedef struct
{
    int      at, turn;
    ivl_d3_t arm;
} spot_t;

static void constrain(reference_t *r, ivl_d3_t along, spot_t plus, spot_t minus, double compliance)
{
    const int    row = N_Q + r->n_c;
    const spot_t points[2] = {plus, minus};
    for (int k = 0; k < 2; k++)
    {
        const double sign = k ? -1.0 : 1.0;
        if (points[k].at < 0)
        {
            continue;  // the ceiling
        }
        const ivl_d3_t moment = ivl_d3_cross(points[k].arm, along);
        for (int axis = 0; axis < 3; axis++)
        {
            r->a[row][points[k].at + axis] += sign * component(along, axis);
            r->a[points[k].at + axis][row] += sign * component(along, axis);
            if (points[k].turn >= 0)
            {
                r->a[row][points[k].turn + axis] += sign * component(moment, axis);
                r->a[points[k].turn + axis][row] += sign * component(moment, axis);
            }
        }
        if (points[k].turn >= 0)
        {
            const ivl_d3_t w = velocity(r, points[k].turn);
            r->b[row] -= sign * ivl_d3_dot(along, ivl_d3_cross(w, ivl_d3_cross(w, points[k].arm)));
        }
    }
    r->a[row][row] = -compliance;
    r->n_c++;
}

/// Springs and dampers of a hip: torque on the rod, none about its own axis.  The universal joint's first axis is fixed in
/// the body, the second turns with the first; world axes throughout.
static ivl_d3_t hip_torque(const ivl_sim_model_t *model, const ivl_rot_t *R, int i, ivl_d3_t n, ivl_d3_t w_relative)
{
    const ivl_sim_params_t *raw = &model->raw;
    const ivl_d3_t          e1 = ivl_rot_apply(R, model->leg.rest_B[i]), e2 = ivl_rot_apply(R, model->leg.inplane_B[i]),
                            e3 = ivl_rot_apply(R, model->leg.sideways_B[i]);
    const double            alpha = atan2(ivl_d3_dot(n, e2), ivl_d3_dot(n, e1)), beta = asin(ivl_d3_dot(n, e3));
    const ivl_d3_t          in_plane = ivl_d3_add(ivl_d3_scale(cos(alpha), e1), ivl_d3_scale(sin(alpha), e2));
    const ivl_d3_t          first = ivl_d3_cross(e1, e2), second = ivl_d3_cross(in_plane, e3);
    // dual basis of (first, second, n): rates are w . dual, and a torque T1 d1 + T2 d2 does the work T1 alpha' + T2 beta'
    const double   volume = ivl_d3_dot(first, ivl_d3_cross(second, n));
    const ivl_d3_t dual_1 = ivl_d3_scale(1.0 / volume, ivl_d3_cross(second, n)),
                   dual_2 = ivl_d3_scale(1.0 / volume, ivl_d3_cross(n, first));
    const double   torque_1 = -raw->leg_stiffness_Nmprad * alpha - raw->leg_damping_Nmsprad * ivl_d3_dot(w_relative, dual_1);
    const double   torque_2 = -raw->leg_stiffness_Nmprad * beta - raw->leg_damping_Nmsprad * ivl_d3_dot(w_relative, dual_2);
    return ivl_d3_add(ivl_d3_scale(torque_1, dual_1), ivl_d3_scale(torque_2, dual_2));
}

static ivl_d3_t rod_of(const ivl_sim_model_t *model, const ivl_sim_kin_t *kin, const ivl_rot_t *R, int i)
{
    const ivl_d3_t hip = ivl_d3_add(ivl_d3_load(kin->p_WB_m), ivl_rot_apply(R, model->leg.hip_B_m[i]));
    return ivl_d3_sub(ivl_d3_load(kin->p_foot_W_m[i]), hip);
}

static void add_leg(reference_t *r, const ivl_sim_model_t *model, const ivl_sim_kin_t *kin, const ivl_rot_t *R, int i, ivl_sim_foot_t foot)
{
    const ivl_sim_params_t *raw = &model->raw;
    const int               rod = 6 + 9 * i, turn = rod + 3, ball = rod + 6;
    const double            length = raw->leg_length_m;
    const ivl_d3_t          n = ivl_d3_scale(1.0 / length, rod_of(model, kin, R, i));
    const ivl_d3_t          w_body = velocity(r, 3), v_foot = ivl_d3_load(kin->v_foot_W_mps[i]);
    const ivl_d3_t          hip = ivl_rot_apply(R, model->leg.hip_B_m[i]);
    const ivl_d3_t          v_hip = ivl_d3_add(velocity(r, 0), ivl_d3_cross(w_body, hip));
    const ivl_d3_t          w_rod = ivl_d3_scale(1.0 / length, ivl_d3_cross(n, ivl_d3_sub(v_foot, v_hip)));
    ivl_d3_store(&r->v[rod], ivl_d3_scale(0.5, ivl_d3_add(v_hip, v_foot)));
    ivl_d3_store(&r->v[turn], w_rod);
    ivl_d3_store(&r->v[ball], v_foot);

    double inertia[3][3];
    rod_inertia(raw->leg_mass_kg * length * length / 12.0, n, inertia);
    set_inertia(r, turn, (const double (*)[3])inertia);
    for (int k = 0; k < 3; k++)
    {
        r->a[rod + k][rod + k] = raw->leg_mass_kg;
        r->a[ball + k][ball + k] = raw->leg_foot_mass_kg;
    }
    ivl_d3_t torque = hip_torque(model, R, i, n, ivl_d3_sub(w_rod, w_body));
    add_force(r, 3, ivl_d3_scale(-1.0, torque));
    if (foot == IVL_SIM_FOOT_STUCK)
    {
        torque = ivl_d3_sub(torque, ivl_d3_scale(raw->leg_foot_damping_Nmsprad, w_rod));  // w_rod is across the rod
    }
    // no gyroscopic term: w_rod is across the rod, so I w is parallel to w
    add_force(r, turn, torque);
    add_force(r, rod, ivl_d3(0.0, 0.0, -raw->leg_mass_kg * raw->world_gravity_mps2));
    add_force(r, ball, ivl_d3(0.0, 0.0, -raw->leg_foot_mass_kg * raw->world_gravity_mps2));

    const spot_t at_hip = {rod, turn, ivl_d3_scale(-0.5 * length, n)}, of_body = {0, 3, hip};
    const spot_t at_foot = {rod, turn, ivl_d3_scale(0.5 * length, n)}, of_ball = {ball, -1, {0.0, 0.0, 0.0}},
                 ceiling = {-1, -1, {0.0, 0.0, 0.0}};
    // the hip: along the rod, with the slip, and across it
    ivl_d3_t across = ivl_d3_cross(n, axis_vector(fabs(n.x) < 0.6 ? 0 : 1));
    across = ivl_d3_scale(1.0 / sqrt(ivl_d3_dot(across, across)), across);
    constrain(r, n, at_hip, of_body, COMPLIANCE);
    constrain(r, across, at_hip, of_body, 0.0);
    constrain(r, ivl_d3_cross(n, across), at_hip, of_body, 0.0);
    for (int axis = 0; axis < 3; axis++)
    {
        constrain(r, axis_vector(axis), at_foot, of_ball, 0.0);
    }
    r->row_of_ceiling[i] = N_Q + r->n_c;
    for (int axis = 2; axis >= 0 && foot != IVL_SIM_FOOT_FREE; axis--)
    {
        if (axis == 2 || foot == IVL_SIM_FOOT_STUCK)
        {
            constrain(r, axis_vector(axis), of_ball, ceiling, 0.0);
        }
    }
}

/// Matrix, forces and known parts of the constraints' accelerations.
static void build(reference_t *r, const ivl_sim_model_t *model, const ivl_sim_kin_t *kin, const ivl_sim_foot_t foot[4], double thrust_N,
                  ivl_d3_t torque_B_Nm)
{
    const ivl_sim_params_t *raw = &model->raw;
    const ivl_rot_t         R = ivl_rot_from_quat(kin->q_WB);
    memset(r, 0, sizeof *r);
    const ivl_d3_t w = ivl_rot_apply(&R, ivl_d3_load(kin->w_B_radps)), v = ivl_d3_load(kin->v_WB_mps);
    ivl_d3_store(&r->v[0], v);
    ivl_d3_store(&r->v[3], w);
    double inertia[3][3];
    body_inertia(raw, &R, inertia);
    set_inertia(r, 3, (const double (*)[3])inertia);
    for (int k = 0; k < 3; k++)
    {
        r->a[k][k] = raw->body_mass_kg;
    }
    const ivl_d3_t v_B = ivl_rot_apply_inverse(&R, v);
    const ivl_d3_t drag = ivl_d3(-raw->aero_drag_xy_Nspm * v_B.x, -raw->aero_drag_xy_Nspm * v_B.y, -raw->aero_drag_z_Nspm * v_B.z);
    add_force(r, 0, ivl_rot_apply(&R, ivl_d3_add(drag, ivl_d3(0.0, 0.0, thrust_N))));
    add_force(r, 0, ivl_d3(0.0, 0.0, -raw->body_mass_kg * raw->world_gravity_mps2));
    add_force(r, 3, ivl_rot_apply(&R, torque_B_Nm));
    add_force(r, 3, ivl_d3_scale(-1.0, ivl_d3_cross(w, times((const double (*)[3])inertia, w))));
    for (int i = 0; i < 4; i++)
    {
        add_leg(r, model, kin, &R, i, foot[i]);
    }
    r->n = N_Q + r->n_c;
}

/// Nearest velocities, in the metric of kinetic energy, that joints and held feet allow: M dv + J^T y = 0, J (v + dv) = 0.
static ivl_sim_kin_t project(const ivl_sim_model_t *model, const ivl_sim_kin_t *kin, const ivl_sim_foot_t foot[4], double slip)
{
    static reference_t r;
    build(&r, model, kin, foot, 0.0, ivl_d3(0.0, 0.0, 0.0));
    for (int i = 0; i < r.n; i++)
    {
        r.b[i] = 0.0;
        for (int j = 0; j < N_Q && i >= N_Q; j++)
        {
            r.b[i] -= r.a[i][j] * r.v[j];
        }
        r.a[i][i] = (i < N_Q) ? r.a[i][i] : r.a[i][i] * slip;
    }
    solve(&r);
    ivl_sim_kin_t   after = *kin;
    const ivl_rot_t R = ivl_rot_from_quat(kin->q_WB);
    const ivl_d3_t  dw = ivl_rot_apply_inverse(&R, ivl_d3_load(&r.x[3]));
    ivl_d3_store(after.v_WB_mps, ivl_d3_add(ivl_d3_load(kin->v_WB_mps), ivl_d3_load(&r.x[0])));
    ivl_d3_store(after.w_B_radps, ivl_d3_add(ivl_d3_load(kin->w_B_radps), dw));
    for (int i = 0; i < 4; i++)
    {
        ivl_d3_store(after.v_foot_W_mps[i], ivl_d3_add(ivl_d3_load(kin->v_foot_W_mps[i]), ivl_d3_load(&r.x[6 + 9 * i + 6])));
    }
    return after;
}

// ---- accelerations -----------------------------------------------------------------------------------------------------

static ivl_sim_params_t full_params(void)
{
    ivl_sim_params_t p = fixture_params();
    p.body_inertia_xx_kgm2 = 4.1e-5;  // three different moments, drag and foot damping: nothing cancels
    p.aero_drag_xy_Nspm = 0.0072;
    p.aero_drag_z_Nspm = 0.0081;
    p.leg_foot_damping_Nmsprad = 3.0e-4;
    p.world_ceiling_height_m = 10.0;
    return p;
}

/// Combination number 0 .. 80 of free, sliding and stuck feet.
static void combination(int number, ivl_sim_foot_t foot[4])
{
    for (int i = 0; i < 4; i++)
    {
        foot[i] = (ivl_sim_foot_t)(number % 3);
        number /= 3;
    }
}

static int count(const ivl_sim_foot_t foot[4], ivl_sim_foot_t which)
{
    int n = 0;
    for (int i = 0; i < 4; i++)
    {
        n += (foot[i] == which) ? 1 : 0;
    }
    return n;
}

static ivl_d3_t lane0(ivl_w3_t a)
{
    return ivl_d3(a.x[0], a.y[0], a.z[0]);
}

static double distance(ivl_d3_t a, ivl_d3_t b)
{
    const ivl_d3_t d = ivl_d3_sub(a, b);
    return sqrt(ivl_d3_dot(d, d));
}

static double size(ivl_d3_t a)
{
    return sqrt(ivl_d3_dot(a, a));
}

static void check_accelerations(const ivl_sim_model_t *model, const ivl_sim_kin_t *kin, const ivl_sim_foot_t foot[4], draws_t *draws)
{
    static reference_t r;
    const double       thrust = draw(draws, 0.0, 0.6);
    const ivl_d3_t     torque = draw_d3(draws, 0.01);
    build(&r, model, kin, foot, thrust, torque);
    solve(&r);
    const ivl_sim_rate_t rate = evaluate(model, kin, foot, thrust, torque);
    const ivl_rot_t      R = ivl_rot_from_quat(kin->q_WB);
    const ivl_d3_t       a = ivl_d3_load(&r.x[0]), alpha = ivl_rot_apply_inverse(&R, ivl_d3_load(&r.x[3]));
    double               scale = 10.0 + size(a) + 0.05 * size(alpha);
    for (int i = 0; i < 4; i++)
    {
        scale += size(ivl_d3_load(&r.x[6 + 9 * i + 6]));
    }
    TEST_ASSERT_DOUBLE_WITHIN(AGREEMENT * scale, 0.0, distance(a, lane0(rate.a_WB_mps2)));
    TEST_ASSERT_DOUBLE_WITHIN(AGREEMENT * scale, 0.0, 0.05 * distance(alpha, lane0(rate.alpha_B_radps2)));
    for (int i = 0; i < 4; i++)
    {
        const ivl_d3_t a_foot = lane0(rate.a_foot_W_mps2[i]);
        TEST_ASSERT_DOUBLE_WITHIN(AGREEMENT * scale, 0.0, distance(ivl_d3_load(&r.x[6 + 9 * i + 6]), a_foot));
        if (foot[i] == IVL_SIM_FOOT_STUCK)
        {
            TEST_ASSERT_TRUE(size(a_foot) <= 0.0);
        }
        if (foot[i] != IVL_SIM_FOOT_FREE)
        {
            // the multiplier is the force with which the foot pulls on the ceiling, positive downwards: M q'' + J^T y = Q
            TEST_ASSERT_DOUBLE_WITHIN(AGREEMENT * scale * model->mass_total_kg, -r.x[r.row_of_ceiling[i]], rate.pull_N[i][0]);
        }
    }
}

static void test_accelerations_equal_the_reference_for_every_combination_of_feet(void)
{
    const ivl_sim_params_t params = full_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    draws_t                draws = {20};
    for (int number = 0; number < 81; number++)
    {
        ivl_sim_foot_t foot[4];
        combination(number, foot);
        for (int k = 0; k < 8; k++)
        {
            const ivl_sim_kin_t any = draw_kin(&model, &draws, 0.7);
            const ivl_sim_kin_t kin = project(&model, &any, foot, 0.0);
            check_accelerations(&model, &kin, foot, &draws);
        }
    }
}

static void test_accelerations_equal_the_reference_when_legs_are_heavy_and_long(void)
{
    ivl_sim_params_t params = full_params();
    params.body_mass_kg = 0.01;
    params.leg_mass_kg = 0.008;
    params.leg_foot_mass_kg = 0.001;
    params.leg_length_m = 0.1;
    params.leg_angle_deg = 10.0;
    const ivl_sim_model_t model = fixture_model(&params);
    draws_t               draws = {21};
    for (int number = 0; number < 81; number++)
    {
        ivl_sim_foot_t foot[4];
        combination(number, foot);
        const ivl_sim_kin_t any = draw_kin(&model, &draws, 0.7);
        const ivl_sim_kin_t kin = project(&model, &any, foot, 0.0);
        check_accelerations(&model, &kin, foot, &draws);
    }
}

static void test_four_stuck_feet_give_finite_forces_when_the_legs_are_parallel(void)
{
    // psi = 0, at rest: four parallel rods, the constraints are redundant; by symmetry each foot carries a quarter
    ivl_sim_params_t params = fixture_params();
    params.leg_angle_deg = 0.0;
    const ivl_sim_model_t model = fixture_model(&params);
    const double          inverted[4] = {1.0, 0.0, 0.0, 0.0};
    const ivl_sim_foot_t  stuck[4] = {IVL_SIM_FOOT_STUCK, IVL_SIM_FOOT_STUCK, IVL_SIM_FOOT_STUCK, IVL_SIM_FOOT_STUCK};
    ivl_sim_kin_t         kin = resting_kin(&model, 0.0, 0.0, 2.0);
    turn_kin(&model, inverted, &kin);
    const ivl_sim_rate_t rate = evaluate(&model, &kin, stuck, 0.0, ivl_d3(0.0, 0.0, 0.0));
    for (int i = 0; i < 4; i++)
    {
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-6, 0.25 * model.mass_total_kg * params.world_gravity_mps2, rate.pull_N[i][0]);
    }
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-3, 0.0, size(lane0(rate.a_WB_mps2)));
}

// ---- impulse -----------------------------------------------------------------------------------------------------------

static double speed_difference(const ivl_sim_kin_t *a, const ivl_sim_kin_t *b)
{
    double worst = distance(ivl_d3_load(a->v_WB_mps), ivl_d3_load(b->v_WB_mps));
    worst = fmax(worst, 0.05 * distance(ivl_d3_load(a->w_B_radps), ivl_d3_load(b->w_B_radps)));
    for (int i = 0; i < 4; i++)
    {
        worst = fmax(worst, distance(ivl_d3_load(a->v_foot_W_mps[i]), ivl_d3_load(b->v_foot_W_mps[i])));
    }
    return worst;
}

static void test_impulse_is_the_simultaneous_projection_on_what_held_feet_allow(void)
{
    const ivl_sim_params_t params = full_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    draws_t                draws = {30};
    for (int number = 0; number < 81; number++)
    {
        ivl_sim_foot_t foot[4];
        combination(number, foot);
        for (int k = 0; k < 4; k++)
        {
            const ivl_sim_kin_t before = draw_kin(&model, &draws, 0.7);
            const ivl_sim_kin_t expected = project(&model, &before, foot, 1.0);
            ivl_sim_kin_t       after = before;
            ivl_sim_impulse(&model, foot, &after);
            TEST_ASSERT_DOUBLE_WITHIN(AGREEMENT * 20.0, 0.0, speed_difference(&expected, &after));
        }
    }
}

static void test_impulse_leaves_stuck_feet_exactly_at_rest_and_sliding_ones_on_the_ceiling(void)
{
    const ivl_sim_params_t params = full_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    draws_t                draws = {31};
    for (int number = 0; number < 81; number++)
    {
        ivl_sim_foot_t foot[4];
        combination(number, foot);
        ivl_sim_kin_t kin = draw_kin(&model, &draws, 0.7);
        ivl_sim_impulse(&model, foot, &kin);
        for (int i = 0; i < 4; i++)
        {
            const double *v = kin.v_foot_W_mps[i];
            TEST_ASSERT_TRUE(foot[i] != IVL_SIM_FOOT_STUCK || (fabs(v[0]) <= 0.0 && fabs(v[1]) <= 0.0));
            TEST_ASSERT_TRUE(foot[i] == IVL_SIM_FOOT_FREE || fabs(v[2]) <= 0.0);
        }
    }
}

static void test_impulse_never_adds_kinetic_energy_and_none_comes_of_a_second(void)
{
    const ivl_sim_params_t params = full_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    draws_t                draws = {32};
    for (int i = 0; i < 5000; i++)
    {
        ivl_sim_foot_t foot[4];
        combination((int)(draw_u64(&draws) % 81), foot);
        const ivl_sim_kin_t before = draw_kin(&model, &draws, 0.7);
        ivl_sim_kin_t       after = before;
        ivl_sim_impulse(&model, foot, &after);
        const double gain = energy_at_rest(&model, &after) - energy_at_rest(&model, &before);
        TEST_ASSERT_TRUE(gain <= 1.0e-12);
        if (count(foot, IVL_SIM_FOOT_FREE) < 4)
        {
            TEST_ASSERT_TRUE(gain < 0.0);
        }
        // the rods' compliance of 1e-3 / kg leaves about that times the effective mass, 0.04 kg, squared in the energy; more
        // in directions in which several legs hold the body almost redundantly
        ivl_sim_kin_t again = after;
        ivl_sim_impulse(&model, foot, &again);
        const double rest = energy_at_rest(&model, &again) - energy_at_rest(&model, &after);
        TEST_ASSERT_TRUE(rest <= 1.0e-12 && rest >= 1.0e-3 * gain - 1.0e-12);
    }
}

static void test_impulse_without_held_feet_changes_nothing(void)
{
    const ivl_sim_params_t params = full_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    const ivl_sim_foot_t   free_feet[4] = {IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE};
    draws_t                draws = {33};
    const ivl_sim_kin_t    before = draw_kin(&model, &draws, 0.7);
    ivl_sim_kin_t          after = before;
    ivl_sim_impulse(&model, free_feet, &after);
    TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, 0.0, speed_difference(&before, &after));
}

static void test_impulse_at_one_foot_keeps_the_angular_momentum_about_it(void)
{
    const ivl_sim_params_t params = full_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    draws_t                draws = {34};
    for (int i = 0; i < 400; i++)
    {
        ivl_sim_foot_t foot[4] = {IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE};
        const int      one = i % 4;
        const bool     slides = (i / 4) % 2 == 1;
        foot[one] = slides ? IVL_SIM_FOOT_SLIDING : IVL_SIM_FOOT_STUCK;
        const ivl_sim_kin_t before = draw_kin(&model, &draws, 0.7);
        ivl_sim_kin_t       after = before;
        ivl_sim_impulse(&model, foot, &after);
        double l0[3], a0[3], l1[3], a1[3];
        ivl_sim_momentum(&model, &before, l0, a0);
        ivl_sim_momentum(&model, &after, l1, a1);
        // the impulse acts at the foot, so the change of angular momentum about the origin is r x (change of momentum)
        const ivl_d3_t dl = ivl_d3_sub(ivl_d3_load(l1), ivl_d3_load(l0)), da = ivl_d3_sub(ivl_d3_load(a1), ivl_d3_load(a0));
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, 0.0, distance(da, ivl_d3_cross(ivl_d3_load(before.p_foot_W_m[one]), dl)));
        if (slides)
        {
            TEST_ASSERT_DOUBLE_WITHIN(1.0e-13, 0.0, hypot(dl.x, dl.y));  // no friction: along the normal only
        }
    }
}

// ---- energy and momentum -------------------------------------------------------------------------------------------------

static void test_momentum_is_the_sum_over_the_parts(void)
{
    const ivl_sim_params_t params = full_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    const ivl_sim_foot_t   free_feet[4] = {IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE};
    static reference_t     r;
    draws_t                draws = {40};
    for (int k = 0; k < 200; k++)
    {
        const ivl_sim_kin_t kin = draw_kin(&model, &draws, 0.7);
        const ivl_rot_t     R = ivl_rot_from_quat(kin.q_WB);
        build(&r, &model, &kin, free_feet, 0.0, ivl_d3(0.0, 0.0, 0.0));
        ivl_d3_t l = ivl_d3(0.0, 0.0, 0.0), a = l;
        double   kinetic = 0.0;
        for (int i = 0; i < N_Q; i++)
        {
            for (int j = 0; j < N_Q; j++)
            {
                kinetic += 0.5 * r.v[i] * r.a[i][j] * r.v[j];
            }
        }
        for (int part = 0; part < 9; part++)
        {
            // body, then rod and foot of each leg
            const int      leg = (part - 1) / 2, at = (part == 0) ? 0 : 6 + 9 * leg + ((part % 2) ? 0 : 6);
            const ivl_d3_t p_foot = ivl_d3_load(kin.p_foot_W_m[leg]), rod = rod_of(&model, &kin, &R, leg);
            const ivl_d3_t p = (part == 0) ? ivl_d3_load(kin.p_WB_m) : ((part % 2) ? ivl_d3_sub(p_foot, ivl_d3_scale(0.5, rod)) : p_foot);
            const ivl_d3_t momentum = ivl_d3_scale(r.a[at][at], ivl_d3_load(&r.v[at]));
            l = ivl_d3_add(l, momentum);
            a = ivl_d3_add(a, ivl_d3_cross(p, momentum));
            if (part == 0 || part % 2)
            {
                double inertia[3][3];
                for (int i = 0; i < 3; i++)
                {
                    memcpy(inertia[i], &r.a[at + 3 + i][at + 3], sizeof inertia[i]);
                }
                a = ivl_d3_add(a, times((const double (*)[3])inertia, ivl_d3_load(&r.v[at + 3])));
            }
        }
        double linear[3], angular[3];
        ivl_sim_momentum(&model, &kin, linear, angular);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-13, 0.0, distance(l, ivl_d3_load(linear)));
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-13, 0.0, distance(a, ivl_d3_load(angular)));
        // kinetic energy: the difference between the state and the same one at rest
        ivl_sim_kin_t still = kin;
        memset(still.v_WB_mps, 0, sizeof still.v_WB_mps);
        memset(still.w_B_radps, 0, sizeof still.w_B_radps);
        memset(still.v_foot_W_mps, 0, sizeof still.v_foot_W_mps);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, kinetic, energy_at_rest(&model, &kin) - energy_at_rest(&model, &still));
    }
}

/// dE/dt = power of thrust and torque - drag - dampers: checked with damping off and on, by the accelerations themselves.
static void test_rate_of_energy_is_the_power_of_what_acts(void)
{
    ivl_sim_params_t params = full_params();
    params.aero_drag_xy_Nspm = 0.0;
    params.aero_drag_z_Nspm = 0.0;
    params.leg_damping_Nmsprad = 0.0;
    params.leg_foot_damping_Nmsprad = 0.0;
    const ivl_sim_model_t model = fixture_model(&params);
    draws_t               draws = {41};
    for (int number = 0; number < 81; number++)
    {
        ivl_sim_foot_t foot[4];
        combination(number, foot);
        const ivl_sim_kin_t any = draw_kin(&model, &draws, 0.7), kin = project(&model, &any, foot, 0.0);
        const double        thrust = draw(&draws, 0.0, 0.6);
        const ivl_d3_t      torque = draw_d3(&draws, 0.01);
        const ivl_rot_t     R = ivl_rot_from_quat(kin.q_WB);
        const double        power =
            thrust * ivl_rot_apply_inverse(&R, ivl_d3_load(kin.v_WB_mps)).z + ivl_d3_dot(torque, ivl_d3_load(kin.w_B_radps));
        // central difference of the energy along the motion that the accelerations describe, over +- 1 us
        const ivl_sim_rate_t rate = evaluate(&model, &kin, foot, thrust, torque);
        double               energy[2];
        for (int side = 0; side < 2; side++)
        {
            const double  h = side ? 1.0e-6 : -1.0e-6;
            ivl_sim_kin_t moved = kin;
            for (int k = 0; k < 3; k++)
            {
                const double a[3] = {rate.a_WB_mps2.x[0], rate.a_WB_mps2.y[0], rate.a_WB_mps2.z[0]};
                const double alpha[3] = {rate.alpha_B_radps2.x[0], rate.alpha_B_radps2.y[0], rate.alpha_B_radps2.z[0]};
                moved.p_WB_m[k] += h * kin.v_WB_mps[k];
                moved.v_WB_mps[k] += h * a[k];
                moved.w_B_radps[k] += h * alpha[k];
                for (int i = 0; i < 4; i++)
                {
                    moved.p_foot_W_m[i][k] += h * kin.v_foot_W_mps[i][k];
                    moved.v_foot_W_mps[i][k] += h * component(lane0(rate.a_foot_W_mps2[i]), k);
                }
            }
            const double *w = kin.w_B_radps, *q = kin.q_WB;
            moved.q_WB[0] += 0.5 * h * (q[3] * w[0] + q[1] * w[2] - q[2] * w[1]);
            moved.q_WB[1] += 0.5 * h * (q[3] * w[1] + q[2] * w[0] - q[0] * w[2]);
            moved.q_WB[2] += 0.5 * h * (q[3] * w[2] + q[0] * w[1] - q[1] * w[0]);
            moved.q_WB[3] -= 0.5 * h * (q[0] * w[0] + q[1] * w[1] + q[2] * w[2]);
            energy[side] = energy_at_rest(&model, &moved);
        }
        // the compliance of the rods takes up to compliance * tension * speed * mass: 1e-3 * 5 N * 5 m/s * 0.04 kg
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-3, power, (energy[1] - energy[0]) / 2.0e-6);
    }
}

// ---- plates ------------------------------------------------------------------------------------------------------------

static void test_highest_point_of_a_plate_is_that_of_its_corners(void)
{
    const ivl_sim_params_t params = fixture_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    draws_t                draws = {50};
    for (int i = 0; i < 1000; i++)
    {
        double q[4];
        draw_quat(&draws, q);
        const ivl_rot_t R = ivl_rot_from_quat(q);
        for (int p = 0; p < IVL_SIM_PLATES; p++)
        {
            double highest = -1.0;
            for (int k = 0; k < IVL_SIM_CORNERS; k++)
            {
                highest = fmax(highest, ivl_d3_dot(R.row[2], model.plate[p].corner_B_m[k]));
            }
            TEST_ASSERT_DOUBLE_WITHIN(1.0e-15, highest, ivl_sim_plate_top(&model.plate[p], R.row[2]));
        }
    }
}

static ivl_sim_kin_t pressed(const ivl_sim_model_t *model, double depth, double vx, double vz)
{
    // level, four upper corners of the propeller plate in the ceiling
    const double  top = 0.011 + 0.0025;
    ivl_sim_kin_t kin = resting_kin(model, 0.0, 0.0, model->raw.world_ceiling_height_m - top + depth);
    kin.v_WB_mps[0] = vx;
    kin.v_WB_mps[2] = vz;
    for (int i = 0; i < 4; i++)
    {
        memcpy(kin.v_foot_W_mps[i], kin.v_WB_mps, sizeof kin.v_WB_mps);
    }
    return kin;
}

static void test_plate_presses_and_rubs_as_the_contact_law_says(void)
{
    const ivl_sim_params_t params = fixture_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    const ivl_sim_foot_t   free_feet[4] = {IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE, IVL_SIM_FOOT_FREE};
    const double cases[][3] = {{1.0e-3, 0.0, 0.0}, {1.0e-3, 0.0, 0.5}, {1.0e-3, 0.0, -0.5}, {5.0e-4, 0.3, 0.0}, {1.0e-3, 0.0, -2.0}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++)
    {
        const double        depth = cases[i][0], vx = cases[i][1], vz = cases[i][2];
        const ivl_sim_kin_t kin = pressed(&model, depth, vx, vz);
        const double        press = fmax(0.0, 4.0 * params.plate_stiffness_Npm * depth * (1.0 + params.plate_damping_spm * vz));
        const double        rub = params.plate_friction_norm * press * vx / hypot(vx, params.plate_slip_speed_mps);
        // the whole vehicle's momentum: what acts is the press, the rub and the weight
        const ivl_sim_rate_t rate = evaluate(&model, &kin, free_feet, 0.0, ivl_d3(0.0, 0.0, 0.0));
        ivl_d3_t             force = ivl_d3_scale(params.body_mass_kg, lane0(rate.a_WB_mps2));
        for (int leg = 0; leg < 4; leg++)
        {
            const ivl_d3_t alpha = lane0(rate.alpha_B_radps2);
            const ivl_d3_t a_hip = ivl_d3_add(lane0(rate.a_WB_mps2), ivl_d3_cross(alpha, model.leg.hip_B_m[leg]));
            const ivl_d3_t a_foot = lane0(rate.a_foot_W_mps2[leg]);
            force = ivl_d3_add(force, ivl_d3_scale(0.5 * params.leg_mass_kg, ivl_d3_add(a_hip, a_foot)));
            force = ivl_d3_add(force, ivl_d3_scale(params.leg_foot_mass_kg, a_foot));
        }
        const double weight = model.mass_total_kg * params.world_gravity_mps2;
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-9 * (1.0 + press), -weight - press, force.z);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-9 * (1.0 + press), -rub, force.x);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-12, depth, rate.overlap_m[IVL_SIM_PROP_PLATE][0]);
        TEST_ASSERT_TRUE(rate.overlap_m[IVL_SIM_BASE_PLATE][0] < 0.0);
    }
}

// ---- integration ---------------------------------------------------------------------------------------------------------

static ivl_sim_kin_t integrate(const ivl_sim_model_t *model, const ivl_sim_kin_t *start, const ivl_sim_foot_t foot[4], double span_s, int n)
{
    ivl_sim_state_t   state, next;
    ivl_sim_contact_t contact;
    ivl_sim_rate_t    last, rate;
    memset(&last, 0, sizeof last);
    memset(&contact, 0, sizeof contact);
    for (int lane = 0; lane < IVL_SIM_LANES; lane++)
    {
        ivl_sim_lane_set(&state, lane, start);
        ivl_sim_contact_set(model, &contact, lane, foot);
    }
    const ivl_sim_load_t load = {.thrust_N = ivl_wide(0.1),
                                 .torque_B_Nm = ivl_w3_of(ivl_d3(1.0e-4, -2.0e-3, 5.0e-4)),
                                 .surface_height_m = ivl_wide(ivl_sim_surface_height(&model->surface, 0.0))};
    ivl_wide_t           dt = ivl_wide(0.0);
    ivl_sim_leapfrog(model, &contact, &load, &dt, &state, &last, &next, &last);
    dt = ivl_wide(span_s / n);
    for (int i = 0; i < n; i++)
    {
        ivl_sim_leapfrog(model, &contact, &load, &dt, &state, &last, &next, &rate);
        state = next;
        last = rate;
    }
    ivl_sim_kin_t end;
    ivl_sim_lane_get(&state, 0, &end);
    return end;
}

static double state_difference(const ivl_sim_kin_t *a, const ivl_sim_kin_t *b)
{
    double worst = speed_difference(a, b);
    worst = fmax(worst, distance(ivl_d3_load(a->p_WB_m), ivl_d3_load(b->p_WB_m)));
    for (int i = 0; i < 4; i++)
    {
        worst = fmax(worst, fabs(a->q_WB[i] - b->q_WB[i]));
        worst = fmax(worst, distance(ivl_d3_load(a->p_foot_W_m[i]), ivl_d3_load(b->p_foot_W_m[i])));
    }
    return worst;
}

static void test_leapfrog_is_of_second_order_for_free_sliding_and_stuck_feet(void)
{
    const ivl_sim_params_t params = full_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    draws_t                draws = {60};
    const int              numbers[] = {0, 2, 8, 26, 1, 5};  // free; one, two, three stuck; one sliding; stuck and sliding
    for (size_t k = 0; k < sizeof numbers / sizeof numbers[0]; k++)
    {
        ivl_sim_foot_t foot[4];
        combination(numbers[k], foot);
        const ivl_sim_kin_t any = draw_kin(&model, &draws, 0.1), start = project(&model, &any, foot, 0.0);
        const ivl_sim_kin_t exact = integrate(&model, &start, foot, 0.02, 64000);
        double              error[3];
        for (int i = 0; i < 3; i++)
        {
            const ivl_sim_kin_t end = integrate(&model, &start, foot, 0.02, 400 << i);
            error[i] = state_difference(&end, &exact);
        }
        TEST_ASSERT_DOUBLE_WITHIN(0.4, 4.0, error[0] / error[1]);
        TEST_ASSERT_DOUBLE_WITHIN(0.4, 4.0, error[1] / error[2]);
    }
}

static void test_a_lane_has_the_same_bits_when_its_neighbours_differ(void)
{
    const ivl_sim_params_t params = full_params();
    const ivl_sim_model_t  model = fixture_model(&params);
    draws_t                draws = {61};
    for (int i = 0; i < 200; i++)
    {
        ivl_sim_state_t   state, next;
        ivl_sim_contact_t contact;
        ivl_sim_rate_t    last, rate;
        ivl_wide_t        dt = ivl_wide(0.0);
        ivl_sim_kin_t     kin[IVL_SIM_LANES];
        ivl_sim_foot_t    foot[IVL_SIM_LANES][4];
        memset(&last, 0, sizeof last);
        memset(&contact, 0, sizeof contact);
        for (int lane = 0; lane < IVL_SIM_LANES; lane++)
        {
            combination((int)(draw_u64(&draws) % 81), foot[lane]);
            kin[lane] = draw_kin(&model, &draws, 0.7);
            ivl_sim_lane_set(&state, lane, &kin[lane]);
            ivl_sim_contact_set(&model, &contact, lane, foot[lane]);
        }
        const ivl_sim_load_t load = {.thrust_N = ivl_wide(0.3),
                                     .torque_B_Nm = ivl_w3_of(ivl_d3(0.001, 0.002, 0.003)),
                                     .surface_height_m = ivl_wide(ivl_sim_surface_height(&model.surface, 0.0))};
        ivl_sim_leapfrog(&model, &contact, &load, &dt, &state, &last, &next, &rate);
        for (int lane = 0; lane < IVL_SIM_LANES; lane++)
        {
            const ivl_sim_rate_t alone = evaluate(&model, &kin[lane], foot[lane], 0.3, ivl_d3(0.001, 0.002, 0.003));
            const double        *a = (const double *)&rate, *b = (const double *)&alone;
            for (size_t k = 0; k < sizeof rate / sizeof *a / IVL_SIM_LANES; k++)
            {
                TEST_ASSERT_EQUAL_MEMORY(&b[k * IVL_SIM_LANES], &a[k * IVL_SIM_LANES + (size_t)lane], sizeof *a);
            }
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_accelerations_equal_the_reference_for_every_combination_of_feet);
    RUN_TEST(test_accelerations_equal_the_reference_when_legs_are_heavy_and_long);
    RUN_TEST(test_four_stuck_feet_give_finite_forces_when_the_legs_are_parallel);
    RUN_TEST(test_impulse_is_the_simultaneous_projection_on_what_held_feet_allow);
    RUN_TEST(test_impulse_leaves_stuck_feet_exactly_at_rest_and_sliding_ones_on_the_ceiling);
    RUN_TEST(test_impulse_never_adds_kinetic_energy_and_none_comes_of_a_second);
    RUN_TEST(test_impulse_without_held_feet_changes_nothing);
    RUN_TEST(test_impulse_at_one_foot_keeps_the_angular_momentum_about_it);
    RUN_TEST(test_momentum_is_the_sum_over_the_parts);
    RUN_TEST(test_rate_of_energy_is_the_power_of_what_acts);
    RUN_TEST(test_highest_point_of_a_plate_is_that_of_its_corners);
    RUN_TEST(test_plate_presses_and_rubs_as_the_contact_law_says);
    RUN_TEST(test_leapfrog_is_of_second_order_for_free_sliding_and_stuck_feet);
    RUN_TEST(test_a_lane_has_the_same_bits_when_its_neighbours_differ);
    return UNITY_END();
}
