#include "world_step_size.h"

#include <stdio.h>

#include "phys_evaluate.h"

// The legs of a vehicle must do with steps that are no shorter than this.
static const double REST_STEP_MIN_S = 1.0e-6;
// A motion is none any more when a foot of 5 cm of leg turns at 100 m/s, or a rod is off by a third of its length.
static const double RODS_TURN_MAX_PER_S = 2.0e3;
static const double STRETCH_MAX = 0.33;
// Contact events that are believed: a foot that came off must move a millimetre before it can touch again.
static const double EVENTS_PER_S = 1.0e5;
// Events that may come at once: all feet and plates touch, stick and come off.
static const double EVENTS_AT_ONCE = 64.0;

enum
{
    N = IVL_SIM_TWIST,
    SQUARINGS = 10
};

// ---- the fastest swing --------------------------------------------------------------------------------------------------

/// Row that gives the velocity of the point x along the unit vector a from a twist.
static void row_of(ivl_d3_t x, ivl_d3_t a, double row[N])
{
    ivl_d3_store(row, a);
    ivl_d3_store(row + 3, ivl_d3_cross(x, a));
}

/// m += factor (a b^T + b a^T) / 2
static void add_product(double m[N][N], double factor, const double a[N], const double b[N])
{
    for (int i = 0; i < N; i++)
    {
        for (int j = 0; j < N; j++)
        {
            m[i][j] += 0.5 * factor * (a[i] * b[j] + b[i] * a[j]);
        }
    }
}

static void multiply(const double a[N][N], const double b[N][N], double product[N][N])
{
    for (int i = 0; i < N; i++)
    {
        for (int j = 0; j < N; j++)
        {
            product[i][j] = 0.0;
            for (int k = 0; k < N; k++)
            {
                product[i][j] += a[i][k] * b[k][j];
            }
        }
    }
}

/// Largest eigenvalue of a matrix whose eigenvalues are none below zero, or slightly more: the trace of a high power is
/// the sum of the powers of all eigenvalues.
static double largest_eigenvalue(const double matrix[N][N])
{
    double power[N][N], square[N][N], trace[SQUARINGS + 1];
    memcpy(power, matrix, sizeof power);
    for (int k = 0; k <= SQUARINGS; k++)
    {
        trace[k] = 0.0;
        for (int i = 0; i < N; i++)
        {
            trace[k] += power[i][i];
        }
        for (int i = 0; i < N; i++)
        {
            for (int j = 0; j < N; j++)
            {
                power[i][j] /= trace[k];
            }
        }
        multiply((const double (*)[N])power, (const double (*)[N])power, square);
        memcpy(power, square, sizeof power);
    }
    double root = 1.0;
    for (int k = SQUARINGS; k > 0; k--)
    {
        root = sqrt(trace[k] * root);
    }
    return trace[0] * root;
}

/// Adds what a leg at rest has of the body's mass matrix, and of the product with itself of the matrix that couples twist and swing.
static void add_leg(const ivl_sim_model_t *model, int i, double mass[N][N], double coupled[N][N])
{
    const ivl_sim_leg_model_t *leg = &model->leg;
    const double               length = model->raw.leg_length_m;
    const ivl_d3_t             hip = leg->hip_B_m[i], foot = ivl_d3_add(hip, ivl_d3_scale(length, leg->rest_B[i]));
    const ivl_d3_t             axes[3] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
    const ivl_d3_t             swings[2] = {leg->inplane_B[i], leg->sideways_B[i]};
    double                     at_hip[N], at_foot[N];
    for (int k = 0; k < 3; k++)
    {
        row_of(hip, axes[k], at_hip);
        row_of(foot, axes[k], at_foot);
        add_product(mass, leg->mass_hip_kg, at_hip, at_hip);
        add_product(mass, 2.0 * leg->mass_cross_kg, at_hip, at_foot);
        add_product(mass, leg->mass_foot_kg, at_foot, at_foot);
    }
    for (int k = 0; k < 2; k++)
    {
        double column[N];
        row_of(hip, swings[k], at_hip);
        row_of(foot, swings[k], at_foot);
        for (int j = 0; j < N; j++)
        {
            column[j] = length * (leg->mass_cross_kg * at_hip[j] + leg->mass_foot_kg * at_foot[j]);
        }
        add_product(coupled, 1.0, column, column);
    }
}

/// Inverse inertia of the fastest swing of the free legs against the free body, about rest.          [MODEL eq. 7.7]
static double swing_mobility(const ivl_sim_model_t *model)
{
    const ivl_sim_params_t *raw = &model->raw;
    const double            diagonal[N] = {raw->body_mass_kg,         raw->body_mass_kg,         raw->body_mass_kg,
                                           raw->body_inertia_xx_kgm2, raw->body_inertia_yy_kgm2, raw->body_inertia_zz_kgm2};
    double                  mass[N][N], inverse[N][N], coupled[N][N], yielding[N][N];
    memset(mass, 0, sizeof mass);
    memset(coupled, 0, sizeof coupled);
    for (int i = 0; i < N; i++)
    {
        mass[i][i] = diagonal[i];
    }
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        add_leg(model, i, mass, coupled);
    }
    ivl_sim_invert6((const double (*)[N])mass, inverse);
    multiply((const double (*)[N])inverse, (const double (*)[N])coupled, yielding);
    return 1.0 / (model->leg.moment_pivot_kgm2 - largest_eigenvalue((const double (*)[N])yielding));
}

// ---- the rest -----------------------------------------------------------------------------------------------------------

/// Inverse inertia against which a leg with a stuck foot swings, at most: what yields there is the body, here for four legs at once.
static double stuck_mobility(const ivl_sim_model_t *model)
{
    const ivl_sim_params_t *raw = &model->raw;
    const double least = ivl_sim_smaller(ivl_sim_smaller(raw->body_inertia_xx_kgm2, raw->body_inertia_yy_kgm2), raw->body_inertia_zz_kgm2);
    const double arm = sqrt(ivl_d3_dot(model->leg.hip_B_m[0], model->leg.hip_B_m[0])) + raw->leg_length_m;
    return IVL_SIM_LEGS * (1.0 / raw->body_mass_kg + arm * arm / least) / (raw->leg_length_m * raw->leg_length_m);
}

/// Damping of the body by air, and at its hips by the joints of four stuck feet.                     [MODEL eq. 7.9]
static double slow_damping(const ivl_sim_model_t *model)
{
    const ivl_sim_params_t *raw = &model->raw;
    const double            xy = raw->leg_hip_xy_m * raw->leg_hip_xy_m, z = raw->leg_hip_z_m * raw->leg_hip_z_m;
    const double            tilting = (xy + z) / ivl_sim_smaller(raw->body_inertia_xx_kgm2, raw->body_inertia_yy_kgm2);
    const double yielding = ivl_sim_larger(1.0 / raw->body_mass_kg, ivl_sim_larger(tilting, 2.0 * xy / raw->body_inertia_zz_kgm2));
    const double joint = raw->leg_foot_damping_Nmsprad / (raw->leg_length_m * raw->leg_length_m);
    return ivl_sim_larger(raw->aero_drag_xy_Nspm, raw->aero_drag_z_Nspm) / raw->body_mass_kg + 2.0 * IVL_SIM_LEGS * joint * yielding;
}

/// Longest step for a motion with the rate of damping g and the frequency w.                         [MODEL eq. 7.6]
IVL_SIM_INLINE ivl_wide_t root_of(ivl_wide_t g_per_s, ivl_wide_t quarter_per_s2)
{
    const double limit = IVL_SIM_STABLE;
    return 2.0 * limit / (g_per_s + ivl_wide_sqrt(g_per_s * g_per_s + 4.0 * quarter_per_s2 * limit));
}

ivl_wide_t ivl_sim_step_longest(const ivl_sim_step_limits_t *step, const ivl_sim_pace_t *pace, ivl_wide_t most_s)
{
    const ivl_mask_t allowed = ivl_sim_step_allowed(step, pace, 1.0, most_s);
    if (!ivl_mask_any(~allowed))
    {
        return most_s;
    }
    const ivl_wide_t quarter = pace->swing_norm * step->swing_quarter_per_s2, turn2 = pace->turn2_per_s2;
    const ivl_wide_t stretch = pace->stretch_norm / IVL_SIM_STRETCH;
    const ivl_wide_t rings = root_of(pace->swing_norm * step->swing_damping_per_s + step->damping_per_s, quarter);
    const ivl_wide_t drifts = ivl_wide_sqrt(step->drift_per_s2 / (turn2 * (turn2 + 4.0 * quarter)));
    const ivl_wide_t stretched = step->longest_s / (stretch * stretch * stretch * stretch);
    const ivl_wide_t longest = ivl_wide_smaller(ivl_wide_smaller(rings, drifts), ivl_wide_smaller(stretched, most_s));
    return ivl_wide_select(allowed, most_s, longest);
}

/// Of all steps that are chosen by these rules; RODS_TURN_MAX_PER_S and STRETCH_MAX are where belief in the motion ends.
static double shortest(const ivl_sim_model_t *model)
{
    const ivl_sim_params_t *raw = &model->raw;
    const double            locked = 1.0 / (IVL_SIM_COS_SIDEWAYS_MIN * IVL_SIM_COS_SIDEWAYS_MIN);
    const double            turning = ivl_sim_smaller(raw->step_flight_s, raw->step_swing_s) / IVL_SIM_TURNS_MAX;
    const double            graded = ivl_sim_smaller(turning, ivl_sim_smaller(raw->step_touch_s, raw->step_plate_s)) * raw->step_scale_norm;
    const ivl_sim_pace_t    wild = {ivl_wide(locked), ivl_wide(RODS_TURN_MAX_PER_S * RODS_TURN_MAX_PER_S), ivl_wide(STRETCH_MAX)};
    return ivl_sim_step_longest(&model->step, &wild, ivl_wide(graded))[0];
}

uint32_t ivl_sim_step_evaluations(const ivl_sim_step_limits_t *step, double span_s)
{
    const double evaluations = step->evaluations_per_s * span_s + step->evaluations_at_once;
    return (evaluations < IVL_SIM_EVALUATIONS_MAX) ? (uint32_t)evaluations : IVL_SIM_EVALUATIONS_MAX;
}

bool ivl_sim_step_derive(ivl_sim_model_t *model, char *error, size_t error_size)
{
    const ivl_sim_params_t *raw = &model->raw;
    ivl_sim_step_limits_t  *step = &model->step;
    const double            mobility = swing_mobility(model);
    step->swing_damping_per_s = raw->leg_damping_Nmsprad * mobility;
    step->swing_quarter_per_s2 = 0.25 * raw->leg_stiffness_Nmprad * mobility;
    step->stuck_norm = ivl_sim_smaller(stuck_mobility(model) / mobility, 1.0);
    step->damping_per_s = slow_damping(model);
    step->drift_per_s2 = IVL_SIM_DRIFT * (4.0 / 3.0) * IVL_SIM_STABILISATION_PER_S * IVL_SIM_STABILISATION_PER_S;
    const double sigma = IVL_SIM_STABILISATION_PER_S;
    step->longest_s = root_of(ivl_wide(2.0 * sigma), ivl_wide(0.25 * sigma * sigma))[0];
    const ivl_sim_pace_t rest = {ivl_wide(1.0), ivl_wide(0.0), ivl_wide(0.0)};
    const double         at_rest = ivl_sim_step_longest(step, &rest, ivl_wide(step->longest_s))[0];
    // positive form: what is no number is refused
    if (!(mobility > 0.0 && at_rest >= REST_STEP_MIN_S))
    {
        snprintf(error, error_size,
                 "leg.stiffness %g, leg.damping %g, leg.foot_damping %g: too much for the inertia of legs and body: steps would have to be "
                 "%g s, the shortest allowed are %g s",
                 raw->leg_stiffness_Nmprad, raw->leg_damping_Nmsprad, raw->leg_foot_damping_Nmsprad, at_rest, REST_STEP_MIN_S);
        return false;
    }
    // a step is a whole share of what is left of its tick, so it may be half of what it was chosen as
    step->shortest_s = 0.5 * shortest(model);
    step->evaluations_per_s = IVL_SIM_STEP_EVALUATIONS * (1.0 / step->shortest_s + EVENTS_PER_S);
    step->evaluations_at_once = IVL_SIM_STEP_EVALUATIONS * EVENTS_AT_ONCE;
    return true;
}
