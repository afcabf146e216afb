#include "sim_dynamics.h"

#include "sim_matrix.h"

// Compliance of a rod, m/(N s^2) in the units of the constraint's matrix.  Four parallel legs hold the body redundantly;
// this makes their forces unique.  With the rate above it equals an axial stiffness of 2e7 N/m.
static const double ROD_COMPLIANCE_PER_KG = 1.0e-3;

enum
{
    N = IVL_SIM_TWIST
};

/// Place of element (i, j), i <= j, in a packed symmetric matrix.
IVL_SIM_INLINE int packed(int i, int j)
{
    const int a = (i < j) ? i : j, b = (i < j) ? j : i;
    return a * N - a * (a - 1) / 2 + b - a;
}

void ivl_sim_lane_get(const ivl_sim_state_t *state, int lane, ivl_sim_kin_t *kin)
{
    const double *from = (const double *)state;
    double       *to = (double *)kin;
    for (size_t i = 0; i < sizeof *kin / sizeof *to; i++)
    {
        to[i] = from[i * IVL_SIM_LANES + (size_t)lane];
    }
}

void ivl_sim_lane_set(ivl_sim_state_t *state, int lane, const ivl_sim_kin_t *kin)
{
    const double *from = (const double *)kin;
    double       *to = (double *)state;
    for (size_t i = 0; i < sizeof *kin / sizeof *from; i++)
    {
        to[i * IVL_SIM_LANES + (size_t)lane] = from[i];
    }
}

// ---- which feet hold on -----------------------------------------------------------------------------------------------

/// Adds a mass mu at x that resists motion along the unit vector a only.
static void add_mass_along(double m[N][N], double mu, ivl_d3_t x, ivl_d3_t a)
{
    const ivl_d3_t moment = ivl_d3_cross(x, a);
    const double   row[N] = {a.x, a.y, a.z, moment.x, moment.y, moment.z};
    for (int i = 0; i < N; i++)
    {
        for (int j = 0; j < N; j++)
        {
            m[i][j] += mu * row[i] * row[j];
        }
    }
}

/// Mass matrix of the body and of the hip ends of the legs.                                       [MODEL eq. 4.8]
static void build_mass(const ivl_sim_model_t *model, const ivl_sim_foot_t foot[IVL_SIM_LEGS], double m[N][N])
{
    const ivl_sim_params_t    *raw = &model->raw;
    const ivl_sim_leg_model_t *leg = &model->leg;
    const double               diagonal[N] = {raw->body_mass_kg,         raw->body_mass_kg,         raw->body_mass_kg,
                                              raw->body_inertia_xx_kgm2, raw->body_inertia_yy_kgm2, raw->body_inertia_zz_kgm2};
    memset(m, 0, sizeof(double[N][N]));
    for (int i = 0; i < N; i++)
    {
        m[i][i] = diagonal[i];
    }
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        // a free foot yields to the hip's acceleration, a held one does not
        const double yields = (foot[i] == IVL_SIM_FOOT_STUCK) ? 0.0 : 1.0;
        const double mu = leg->mass_hip_kg - yields * leg->mass_cross_kg * leg->mass_cross_kg / leg->mass_foot_kg;
        add_mass_along(m, mu, leg->hip_B_m[i], ivl_d3(1.0, 0.0, 0.0));
        add_mass_along(m, mu, leg->hip_B_m[i], ivl_d3(0.0, 1.0, 0.0));
        add_mass_along(m, mu, leg->hip_B_m[i], ivl_d3(0.0, 0.0, 1.0));
    }
}

static void store_packed(const double m[N][N], ivl_wide_t to[IVL_SIM_PACKED], int lane)
{
    for (int i = 0; i < N; i++)
    {
        for (int j = i; j < N; j++)
        {
            to[packed(i, j)][lane] = m[i][j];
        }
    }
}

void ivl_sim_contact_set(const ivl_sim_model_t *model, ivl_sim_contact_t *contact, int lane, const ivl_sim_foot_t foot[IVL_SIM_LEGS])
{
    double m[N][N], inverse[N][N];
    build_mass(model, foot, m);
    ivl_sim_invert6((const double (*)[N])m, inverse);
    store_packed((const double (*)[N])m, contact->mass6, lane);
    store_packed((const double (*)[N])inverse, contact->inverse_mass6, lane);
    contact->any_sliding = false;
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        contact->inverse_mass[i][lane] = (foot[i] == IVL_SIM_FOOT_STUCK) ? 0.0 : 1.0 / model->leg.mass_foot_kg;
        contact->sliding[i][lane] = (foot[i] == IVL_SIM_FOOT_SLIDING) ? 1.0 : 0.0;
        contact->any_sliding = contact->any_sliding || ivl_mask_any(contact->sliding[i] > 0.0);
    }
}

/// A sliding foot does not yield along the ceiling's normal: its hip carries more mass in that direction, which turns with
/// the body, so that the matrix must be made anew at each evaluation.
static void inverse_while_sliding(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact, const ivl_w3_t *up,
                                  ivl_wide_t inverse6[IVL_SIM_PACKED])
{
    const ivl_sim_leg_model_t *leg = &model->leg;
    for (int lane = 0; lane < IVL_SIM_LANES; lane++)
    {
        double m[N][N], inverse[N][N];
        for (int i = 0; i < N; i++)
        {
            for (int j = 0; j < N; j++)
            {
                m[i][j] = contact->mass6[packed(i, j)][lane];
            }
        }
        bool slides = false;
        for (int i = 0; i < IVL_SIM_LEGS; i++)
        {
            const double mu = contact->sliding[i][lane] * leg->mass_cross_kg * leg->mass_cross_kg / leg->mass_foot_kg;
            slides = slides || contact->sliding[i][lane] > 0.0;
            add_mass_along(m, mu, leg->hip_B_m[i], ivl_d3(up->x[lane], up->y[lane], up->z[lane]));
        }
        if (slides)
        {
            ivl_sim_invert6((const double (*)[N])m, inverse);
            store_packed((const double (*)[N])inverse, inverse6, lane);
        }
    }
}

// ---- one evaluation ---------------------------------------------------------------------------------------------------

/// Positions and velocities in body axes.
typedef struct
{
    ivl_wrot_t R_WB;
    ivl_w3_t   up;                   ///< the world's z axis
    ivl_w3_t   v, w;                 ///< of the body
    ivl_w3_t   rod[IVL_SIM_LEGS];    ///< hip to foot
    ivl_w3_t   n[IVL_SIM_LEGS];      ///< rod / length
    ivl_w3_t   v_rod[IVL_SIM_LEGS];  ///< velocity of the foot minus that of the hip
} kinematics_t;

IVL_SIM_INLINE void kinematics(const ivl_sim_model_t *model, const ivl_sim_state_t *s, kinematics_t *k)
{
    const ivl_wide_t inv_length = ivl_wide(1.0 / model->raw.leg_length_m);
    k->R_WB = ivl_wrot_from_quat(s->q_WB);
    k->up = k->R_WB.row[2];
    k->w = s->w_B_radps;
    k->v = ivl_wrot_apply_inverse(&k->R_WB, s->v_WB_mps);
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const ivl_d3_t hip = model->leg.hip_B_m[i];
        const ivl_w3_t foot = ivl_wrot_apply_inverse(&k->R_WB, ivl_w3_sub(s->p_foot_W_m[i], s->p_WB_m));
        const ivl_w3_t v_foot = ivl_wrot_apply_inverse(&k->R_WB, s->v_foot_W_mps[i]);
        k->rod[i] = (ivl_w3_t){foot.x - hip.x, foot.y - hip.y, foot.z - hip.z};
        k->n[i] = ivl_w3_scale(inv_length, k->rod[i]);
        k->v_rod[i] = ivl_w3_sub(v_foot, ivl_w3_add(k->v, ivl_w3_cross_d3(k->w, hip)));
    }
}

/// A hip's two hinges: angles still to be unfolded, and the directions in which they move the rod.       [MODEL eq. 3.2]
typedef struct
{
    ivl_w3_t   e_alpha, e_beta;
    ivl_wide_t inv_cos_beta;
} hinge_t;

/// @param[out] angle, t  of the deflections in the leg's plane and sideways, for ivl_wide_unfold
IVL_SIM_INLINE hinge_t hinge(const ivl_sim_leg_model_t *leg, int i, ivl_w3_t n, ivl_angle_t angle[2], ivl_wide_t t_angle[2])
{
    const ivl_d3_t   e1 = leg->rest_B[i], e2 = leg->inplane_B[i], e3 = leg->sideways_B[i];
    const ivl_wide_t c = ivl_w3_dot_d3(n, e1), s = ivl_w3_dot_d3(n, e2), t = ivl_w3_dot_d3(n, e3);
    const ivl_wide_t root = ivl_wide_sqrt(c * c + s * s);
    const ivl_wide_t least = ivl_wide(IVL_SIM_COS_SIDEWAYS_MIN);
    const ivl_wide_t lever = ivl_wide_select(root > least, root, least);
    // three quotients from one division: divisions are what an evaluation spends most of its time on
    const ivl_angle_t a = ivl_wide_fold(s, c), b = ivl_wide_fold(t, root);
    const ivl_wide_t  both = a.den * b.den;
    const ivl_wide_t  reciprocal = 1.0 / (both * lever);
    const ivl_wide_t  inv = both * reciprocal;
    const ivl_wide_t  ca = c * inv, sa = s * inv;
    hinge_t           h;
    angle[0] = a;
    angle[1] = b;
    t_angle[0] = a.num * b.den * lever * reciprocal;
    t_angle[1] = b.num * a.den * lever * reciprocal;
    h.inv_cos_beta = inv;
    h.e_alpha = (ivl_w3_t){ca * e2.x - sa * e1.x, ca * e2.y - sa * e1.y, ca * e2.z - sa * e1.z};
    h.e_beta = (ivl_w3_t){root * e3.x - t * (ca * e1.x + sa * e2.x), root * e3.y - t * (ca * e1.y + sa * e2.y),
                          root * e3.z - t * (ca * e1.z + sa * e2.z)};
    return h;
}

IVL_SIM_INLINE ivl_wide_t larger(ivl_wide_t a, ivl_wide_t b)
{
    return ivl_wide_select(b > a, b, a);
}

/// How much faster than at rest the fastest leg swings.  One that is bent sideways has less inertia about its first hinge; one
/// whose foot is stuck has the body's.                                                             [MODEL eq. 7.8]
IVL_SIM_INLINE ivl_wide_t fastest_swing(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact, const hinge_t h[IVL_SIM_LEGS])
{
    ivl_wide_t fastest = ivl_wide(0.0);
    IVL_SIM_UNROLL
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const ivl_wide_t share = ivl_wide_select(contact->inverse_mass[i] > 0.0, ivl_wide(1.0), ivl_wide(model->step.stuck_norm));
        const ivl_wide_t swing = share * h[i].inv_cos_beta * h[i].inv_cos_beta;
        fastest = larger(fastest, swing);
    }
    return fastest;
}

/// Forces of the hips' springs and dampers on the feet; a rod's hip end gets the opposite, the body the opposite couple.
/// [MODEL eq. 3.4]
IVL_SIM_INLINE void hip_couples(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact, const kinematics_t *k,
                                ivl_w3_t couple[IVL_SIM_LEGS], ivl_wide_t *swing)
{
    const double stiffness = model->raw.leg_stiffness_Nmprad, damping = model->raw.leg_damping_Nmsprad;
    const double inv_length = 1.0 / model->raw.leg_length_m;
    hinge_t      h[IVL_SIM_LEGS];
    ivl_angle_t  folded[2 * IVL_SIM_LEGS];
    ivl_wide_t   t[2 * IVL_SIM_LEGS], deflection[2 * IVL_SIM_LEGS];
    IVL_SIM_UNROLL
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        h[i] = hinge(&model->leg, i, k->n[i], &folded[2 * i], &t[2 * i]);
    }
    ivl_wide_unfold(folded, t, deflection, 2 * IVL_SIM_LEGS);
    *swing = fastest_swing(model, contact, h);
    IVL_SIM_UNROLL
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const ivl_w3_t   turning = ivl_w3_sub(k->v_rod[i], ivl_w3_cross(k->w, k->rod[i]));
        const ivl_wide_t alpha_rate = inv_length * ivl_w3_dot(turning, h[i].e_alpha) * h[i].inv_cos_beta;
        const ivl_wide_t beta_rate = inv_length * ivl_w3_dot(turning, h[i].e_beta);
        const ivl_wide_t torque_alpha = -(stiffness * deflection[2 * i] + damping * alpha_rate) * inv_length;
        const ivl_wide_t torque_beta = -(stiffness * deflection[2 * i + 1] + damping * beta_rate) * inv_length;
        couple[i] = ivl_w3_plus(ivl_w3_scale(torque_alpha * h[i].inv_cos_beta, h[i].e_alpha), torque_beta, h[i].e_beta);
    }
}

/// Without the part along the ceiling's normal, for a foot that slides.
IVL_SIM_INLINE ivl_w3_t along_ceiling(ivl_wide_t sliding, ivl_w3_t up, ivl_w3_t a)
{
    return ivl_w3_plus(a, -sliding * ivl_w3_dot(up, a), up);
}

/// A leg's row of the constraint: multiplier direction g at the hip, its moment, its own compliance.  [MODEL eq. 4.9]
typedef struct
{
    ivl_w3_t   g, hip_x_g;
    ivl_wide_t compliance;
} row_t;

IVL_SIM_INLINE row_t constraint_row(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact, const kinematics_t *k, int i)
{
    const ivl_w3_t pn = along_ceiling(contact->sliding[i], k->up, k->n[i]);
    row_t          r;
    r.g = ivl_w3_plus(k->n[i], model->leg.mass_cross_kg * contact->inverse_mass[i], pn);
    r.hip_x_g = ivl_w3_cross_from_d3(model->leg.hip_B_m[i], r.g);
    r.compliance = contact->inverse_mass[i] * ivl_w3_dot(k->n[i], pn) + ROD_COMPLIANCE_PER_KG;
    return r;
}

/// Solves the symmetric positive definite system a x = b of four equations, upper triangle given, by elimination of the
/// first two unknowns at once: two divisions in a row instead of four.
IVL_SIM_INLINE void solve4(ivl_wide_t a[4][4], const ivl_wide_t b[4], ivl_wide_t x[4])
{
    // inverse of the leading block
    const ivl_wide_t d = 1.0 / (a[0][0] * a[1][1] - a[0][1] * a[0][1]);
    const ivl_wide_t p00 = a[1][1] * d, p01 = -a[0][1] * d, p11 = a[0][0] * d;
    // y = inverse * right part, and of the right-hand side
    const ivl_wide_t y02 = p00 * a[0][2] + p01 * a[1][2], y12 = p01 * a[0][2] + p11 * a[1][2];
    const ivl_wide_t y03 = p00 * a[0][3] + p01 * a[1][3], y13 = p01 * a[0][3] + p11 * a[1][3];
    const ivl_wide_t z0 = p00 * b[0] + p01 * b[1], z1 = p01 * b[0] + p11 * b[1];
    // what remains for the last two unknowns
    const ivl_wide_t s22 = a[2][2] - a[0][2] * y02 - a[1][2] * y12;
    const ivl_wide_t s23 = a[2][3] - a[0][2] * y03 - a[1][2] * y13;
    const ivl_wide_t s33 = a[3][3] - a[0][3] * y03 - a[1][3] * y13;
    const ivl_wide_t r2 = b[2] - a[0][2] * z0 - a[1][2] * z1;
    const ivl_wide_t r3 = b[3] - a[0][3] * z0 - a[1][3] * z1;
    const ivl_wide_t e = 1.0 / (s22 * s33 - s23 * s23);
    x[2] = (s33 * r2 - s23 * r3) * e;
    x[3] = (s22 * r3 - s23 * r2) * e;
    x[0] = z0 - y02 * x[2] - y03 * x[3];
    x[1] = z1 - y12 * x[2] - y13 * x[3];
}

/// Solves  M u = b + J^T x,  J u + compliance x = r  for the twist u and the multipliers x.        [MODEL eq. 4.10]
IVL_SIM_INLINE void solve_constrained(const ivl_wide_t inverse6[IVL_SIM_PACKED], const row_t rows[IVL_SIM_LEGS], const ivl_wide_t b[N],
                                      const ivl_wide_t r[IVL_SIM_LEGS], ivl_wide_t u[N], ivl_wide_t x[IVL_SIM_LEGS])
{
    ivl_wide_t J[IVL_SIM_LEGS][N], W[IVL_SIM_LEGS][N], A[4][4], rhs[4];
    IVL_SIM_UNROLL
    for (int leg = 0; leg < IVL_SIM_LEGS; leg++)
    {
        const ivl_wide_t row[N] = {rows[leg].g.x,       rows[leg].g.y,       rows[leg].g.z,
                                   rows[leg].hip_x_g.x, rows[leg].hip_x_g.y, rows[leg].hip_x_g.z};
        rhs[leg] = r[leg];
        IVL_SIM_UNROLL
        for (int i = 0; i < N; i++)
        {
            J[leg][i] = row[i];
            W[leg][i] = inverse6[packed(i, 0)] * row[0];
            IVL_SIM_UNROLL
            for (int j = 1; j < N; j++)
            {
                W[leg][i] += inverse6[packed(i, j)] * row[j];
            }
            rhs[leg] -= W[leg][i] * b[i];
        }
        IVL_SIM_UNROLL
        for (int other = 0; other <= leg; other++)
        {
            A[other][leg] = W[leg][0] * J[other][0];
            IVL_SIM_UNROLL
            for (int i = 1; i < N; i++)
            {
                A[other][leg] += W[leg][i] * J[other][i];
            }
        }
        A[leg][leg] += rows[leg].compliance;
    }
    solve4(A, rhs, x);
    IVL_SIM_UNROLL
    for (int i = 0; i < N; i++)
    {
        u[i] = inverse6[packed(i, 0)] * b[0];
        IVL_SIM_UNROLL
        for (int j = 1; j < N; j++)
        {
            u[i] += inverse6[packed(i, j)] * b[j];
        }
        IVL_SIM_UNROLL
        for (int leg = 0; leg < IVL_SIM_LEGS; leg++)
        {
            u[i] += W[leg][i] * x[leg];
        }
    }
}

/// Height of the highest point of a plate above the body origin.
IVL_SIM_INLINE ivl_wide_t plate_top(const ivl_sim_plate_t *plate, ivl_w3_t up)
{
    return ivl_wide_abs(up.x) * plate->half_m[0] + ivl_wide_abs(up.y) * plate->half_m[1] + ivl_wide_abs(up.z) * plate->half_m[2] +
           up.z * plate->center_z_m;
}

/// Adds the wrench of one corner that presses on the ceiling: Hunt-Crossley normal force, regularised Coulomb friction.
/// [MODEL eq. 5.1, 5.2]
IVL_SIM_INLINE void corner_force(const ivl_sim_params_t *raw, const kinematics_t *k, ivl_wide_t height, ivl_d3_t x, ivl_wide_t b[N])
{
    const ivl_wide_t zero = ivl_wide(0.0);
    const ivl_wide_t depth = height + ivl_w3_dot_d3(k->up, x) - raw->world_ceiling_height_m;
    const ivl_w3_t   v = ivl_w3_add(k->v, ivl_w3_cross_d3(k->w, x));
    const ivl_wide_t depth_rate = ivl_w3_dot(k->up, v);
    const ivl_wide_t force = raw->plate_stiffness_Npm * depth * (1.0 + raw->plate_damping_spm * depth_rate);
    const ivl_wide_t press = ivl_wide_select((depth > zero) & (force > zero), force, zero);
    const ivl_w3_t   slip = ivl_w3_plus(v, -depth_rate, k->up);
    const double     slow = raw->plate_slip_speed_mps;
    const ivl_wide_t drag = raw->plate_friction_norm * press / ivl_wide_sqrt(ivl_w3_dot(slip, slip) + slow * slow);
    const ivl_w3_t   f = ivl_w3_sub(ivl_w3_scale(-press, k->up), ivl_w3_scale(drag, slip));
    const ivl_w3_t   m = ivl_w3_cross_from_d3(x, f);
    const ivl_wide_t wrench[N] = {f.x, f.y, f.z, m.x, m.y, m.z};
    for (int i = 0; i < N; i++)
    {
        b[i] += wrench[i];
    }
}

/// What acts on the body except the legs: weight, rotors, drag, plates, gyroscopic moment.
IVL_SIM_INLINE void body_wrench(const ivl_sim_model_t *model, const ivl_sim_load_t *load, const kinematics_t *k, ivl_wide_t height,
                                ivl_wide_t b[N], ivl_wide_t overlap[IVL_SIM_PLATES])
{
    const ivl_sim_params_t *raw = &model->raw;
    const double            weight = raw->body_mass_kg * raw->world_gravity_mps2;
    const double            ixx = raw->body_inertia_xx_kgm2, iyy = raw->body_inertia_yy_kgm2, izz = raw->body_inertia_zz_kgm2;
    b[0] = -weight * k->up.x - raw->aero_drag_xy_Nspm * k->v.x;
    b[1] = -weight * k->up.y - raw->aero_drag_xy_Nspm * k->v.y;
    b[2] = -weight * k->up.z - raw->aero_drag_z_Nspm * k->v.z + load->thrust_N;
    b[3] = load->torque_B_Nm.x - (izz - iyy) * k->w.y * k->w.z;
    b[4] = load->torque_B_Nm.y - (ixx - izz) * k->w.z * k->w.x;
    b[5] = load->torque_B_Nm.z - (iyy - ixx) * k->w.x * k->w.y;
    for (int p = 0; p < IVL_SIM_PLATES; p++)
    {
        overlap[p] = height + plate_top(&model->plate[p], k->up) - raw->world_ceiling_height_m;
        if (ivl_mask_any(overlap[p] > 0.0))
        {
            for (int i = 0; i < IVL_SIM_CORNERS; i++)
            {
                corner_force(raw, k, height, model->plate[p].corner_B_m[i], b);
            }
        }
    }
}

IVL_SIM_INLINE void subtract_wrench(ivl_wide_t b[N], ivl_w3_t force, ivl_w3_t moment)
{
    b[0] -= force.x;
    b[1] -= force.y;
    b[2] -= force.z;
    b[3] -= moment.x;
    b[4] -= moment.y;
    b[5] -= moment.z;
}

IVL_SIM_INLINE void accelerate(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact, const ivl_sim_load_t *load,
                               const ivl_sim_state_t *s, ivl_sim_rate_t *rate)
{
    const ivl_sim_leg_model_t *leg = &model->leg;
    const double               length = model->raw.leg_length_m, gravity = model->raw.world_gravity_mps2;
    const double               joint = model->raw.leg_foot_damping_Nmsprad / (length * length);
    const double               sigma = IVL_SIM_STABILISATION_PER_S;
    kinematics_t               k;
    kinematics(model, s, &k);
    ivl_wide_t b[N], r[IVL_SIM_LEGS], u[N], axial[IVL_SIM_LEGS], fastest2 = ivl_wide(0.0), longest = ivl_wide(0.0);
    ivl_w3_t   f_foot[IVL_SIM_LEGS], centripetal[IVL_SIM_LEGS], couple[IVL_SIM_LEGS];
    row_t      rows[IVL_SIM_LEGS];
    body_wrench(model, load, &k, s->p_WB_m.z, b, rate->overlap_m);
    hip_couples(model, contact, &k, couple, &rate->swing_norm);
    IVL_SIM_UNROLL
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const ivl_d3_t   hip = leg->hip_B_m[i];
        const ivl_wide_t inv_mass = contact->inverse_mass[i], sliding = contact->sliding[i];

        // forces on the rod's ends: hip springs, friction of a stuck foot's joint, weight
        const ivl_wide_t held = ivl_wide_select(inv_mass > 0.0, ivl_wide(0.0), ivl_wide(joint));
        const ivl_w3_t   pair = ivl_w3_plus(couple[i], -held, k.v_rod[i]);
        f_foot[i] = ivl_w3_plus(pair, ivl_wide(-leg->weight_foot_kg * gravity), k.up);

        // what the hip takes from the body if neither the body nor the constraint accelerated it
        centripetal[i] = ivl_w3_cross(k.w, ivl_w3_cross_d3(k.w, hip));
        const ivl_w3_t at_foot = ivl_w3_plus(f_foot[i], ivl_wide(-leg->mass_cross_kg), centripetal[i]);
        const ivl_w3_t yield = ivl_w3_scale(leg->mass_cross_kg * inv_mass, along_ceiling(sliding, k.up, at_foot));
        const ivl_w3_t weight = ivl_w3_plus(pair, ivl_wide(leg->weight_hip_kg * gravity), k.up);
        const ivl_w3_t at_hip = ivl_w3_plus(ivl_w3_add(weight, yield), ivl_wide(leg->mass_hip_kg), centripetal[i]);
        subtract_wrench(b, at_hip, ivl_w3_add(ivl_w3_cross_from_d3(hip, at_hip), ivl_w3_cross(k.rod[i], couple[i])));

        // length constraint: n.(a_foot - a_hip) = -|v_rod|^2 / L - stabilisation
        rows[i] = constraint_row(model, contact, &k, i);
        const ivl_wide_t speed2 = ivl_w3_dot(k.v_rod[i], k.v_rod[i]);
        const ivl_wide_t excess = ivl_w3_dot(k.rod[i], k.rod[i]) - length * length;
        fastest2 = larger(fastest2, speed2);
        longest = larger(longest, ivl_wide_abs(excess));
        const ivl_wide_t curvature =
            speed2 * (1.0 / length) + 2.0 * sigma * ivl_w3_dot(k.n[i], k.v_rod[i]) + (0.5 * sigma * sigma / length) * excess;
        r[i] = curvature + inv_mass * ivl_w3_dot(k.n[i], along_ceiling(sliding, k.up, f_foot[i])) - ivl_w3_dot(rows[i].g, centripetal[i]);
    }
    rate->turn2_per_s2 = fastest2 * (1.0 / (length * length));
    rate->stretch_norm = longest * (0.5 / (length * length));
    const ivl_wide_t *inverse6 = contact->inverse_mass6;
    ivl_wide_t        rebuilt[IVL_SIM_PACKED];
    if (contact->any_sliding)
    {
        memcpy(rebuilt, contact->inverse_mass6, sizeof rebuilt);
        inverse_while_sliding(model, contact, &k.up, rebuilt);
        inverse6 = rebuilt;
    }
    solve_constrained(inverse6, (const row_t *)rows, b, r, u, axial);

    // back to the feet, and to world axes
    const ivl_w3_t a = {u[0], u[1], u[2]}, alpha = {u[3], u[4], u[5]};
    rate->a_WB_mps2 = ivl_wrot_apply(&k.R_WB, a);
    rate->alpha_B_radps2 = alpha;
    IVL_SIM_UNROLL
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const ivl_w3_t a_hip = ivl_w3_add(ivl_w3_add(a, centripetal[i]), ivl_w3_cross_d3(alpha, leg->hip_B_m[i]));
        const ivl_w3_t net = ivl_w3_plus(ivl_w3_plus(f_foot[i], -axial[i], k.n[i]), ivl_wide(-leg->mass_cross_kg), a_hip);
        const ivl_w3_t a_foot = ivl_w3_scale(contact->inverse_mass[i], along_ceiling(contact->sliding[i], k.up, net));
        rate->a_foot_W_mps2[i] = ivl_wrot_apply(&k.R_WB, a_foot);
        rate->pull_N[i] = -ivl_w3_dot(k.up, net);
    }
}

// ---- integration ------------------------------------------------------------------------------------------------------

/// q + h/2 q (0, w): turns q by h w, to second order; the length is corrected where it matters.
IVL_SIM_INLINE void turn(const ivl_wide_t q[4], const ivl_wide_t along[4], ivl_wide_t h, ivl_w3_t w, ivl_wide_t out[4])
{
    const ivl_wide_t half = 0.5 * h;
    out[0] = q[0] + half * (along[3] * w.x + along[1] * w.z - along[2] * w.y);
    out[1] = q[1] + half * (along[3] * w.y + along[2] * w.x - along[0] * w.z);
    out[2] = q[2] + half * (along[3] * w.z + along[0] * w.y - along[1] * w.x);
    out[3] = q[3] - half * (along[0] * w.x + along[1] * w.y + along[2] * w.z);
}

IVL_SIM_INLINE void normalize(ivl_wide_t q[4])
{
    const ivl_wide_t s = 1.0 / ivl_wide_sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (int i = 0; i < 4; i++)
    {
        q[i] *= s;
    }
}

IVL_SIM_INLINE void leapfrog(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact, const ivl_sim_load_t *load,
                             const ivl_wide_t *dt_s, const ivl_sim_state_t *s, const ivl_sim_rate_t *last, ivl_sim_state_t *next,
                             ivl_sim_rate_t *rate)
{
    const ivl_wide_t dt = *dt_s;  // by address: a vector argument may not pass between functions of different targets
    const ivl_wide_t half = 0.5 * dt;
    ivl_sim_state_t  mid;
    mid.p_WB_m = ivl_w3_plus(s->p_WB_m, half, s->v_WB_mps);
    mid.v_WB_mps = ivl_w3_plus(s->v_WB_mps, half, last->a_WB_mps2);
    mid.w_B_radps = ivl_w3_plus(s->w_B_radps, half, last->alpha_B_radps2);
    const ivl_w3_t w_quarter = ivl_w3_plus(s->w_B_radps, 0.5 * half, last->alpha_B_radps2);
    turn(s->q_WB, s->q_WB, half, w_quarter, mid.q_WB);
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        mid.p_foot_W_m[i] = ivl_w3_plus(s->p_foot_W_m[i], half, s->v_foot_W_mps[i]);
        mid.v_foot_W_mps[i] = ivl_w3_plus(s->v_foot_W_mps[i], half, last->a_foot_W_mps2[i]);
    }
    accelerate(model, contact, load, &mid, rate);
    next->v_WB_mps = ivl_w3_plus(s->v_WB_mps, dt, rate->a_WB_mps2);
    next->w_B_radps = ivl_w3_plus(s->w_B_radps, dt, rate->alpha_B_radps2);
    next->p_WB_m = ivl_w3_plus(mid.p_WB_m, half, next->v_WB_mps);
    const ivl_w3_t w_mean = ivl_w3_scale(ivl_wide(0.5), ivl_w3_add(s->w_B_radps, next->w_B_radps));
    turn(s->q_WB, mid.q_WB, dt, w_mean, next->q_WB);
    normalize(next->q_WB);
    next->pitch_rad = s->pitch_rad - dt * w_mean.y;
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        next->v_foot_W_mps[i] = ivl_w3_plus(s->v_foot_W_mps[i], dt, rate->a_foot_W_mps2[i]);
        next->p_foot_W_m[i] = ivl_w3_plus(mid.p_foot_W_m[i], half, next->v_foot_W_mps[i]);
    }
}

// The same source, for registers of 128, 256 and 512 bits.  All give the same bits: lanes never mix, and without fused
// multiply-add every width rounds alike.  A build can be held to narrower ones, to show that.
#if !defined(IVL_SIM_WIDEST_BITS)
#define IVL_SIM_WIDEST_BITS 512
#endif
#if defined(__x86_64__)
#define STEP_FOR(name, isa)                                                                                                                \
    __attribute__((target(isa))) static void name(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact,                          \
                                                  const ivl_sim_load_t *load, const ivl_wide_t *dt_s, const ivl_sim_state_t *state,        \
                                                  const ivl_sim_rate_t *last, ivl_sim_state_t *next, ivl_sim_rate_t *rate)                 \
    {                                                                                                                                      \
        leapfrog(model, contact, load, dt_s, state, last, next, rate);                                                                     \
    }
#if IVL_SIM_WIDEST_BITS >= 256
STEP_FOR(leapfrog_avx2, "avx2")
#endif
#if IVL_SIM_WIDEST_BITS >= 512 && defined(__clang__)
STEP_FOR(leapfrog_avx512, "avx512f,avx512dq")
#elif IVL_SIM_WIDEST_BITS >= 512
STEP_FOR(leapfrog_avx512, "avx512f,avx512dq,prefer-vector-width=512")
#endif
#endif

void ivl_sim_leapfrog(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact, const ivl_sim_load_t *load, const ivl_wide_t *dt_s,
                      const ivl_sim_state_t *state, const ivl_sim_rate_t *last, ivl_sim_state_t *next, ivl_sim_rate_t *rate)
{
#if defined(__x86_64__) && IVL_SIM_WIDEST_BITS >= 512
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq"))
    {
        leapfrog_avx512(model, contact, load, dt_s, state, last, next, rate);
        return;
    }
#endif
#if defined(__x86_64__) && IVL_SIM_WIDEST_BITS >= 256
    if (__builtin_cpu_supports("avx2"))
    {
        leapfrog_avx2(model, contact, load, dt_s, state, last, next, rate);
        return;
    }
#endif
    leapfrog(model, contact, load, dt_s, state, last, next, rate);
}

// ---- impulse, energy, momentum of one vehicle -------------------------------------------------------------------------

/// The same vehicle in all lanes, to use the wide functions for one.
static void spread(const ivl_sim_kin_t *kin, ivl_sim_state_t *state)
{
    for (int lane = 0; lane < IVL_SIM_LANES; lane++)
    {
        ivl_sim_lane_set(state, lane, kin);
    }
}

static void spread_contact(ivl_sim_contact_t *contact)
{
    double *number = (double *)contact;
    for (size_t i = 0; i < offsetof(ivl_sim_contact_t, any_sliding) / sizeof *number; i++)
    {
        number[i] = number[i - i % IVL_SIM_LANES];
    }
}

static ivl_d3_t first(ivl_w3_t a)
{
    return ivl_d3(a.x[0], a.y[0], a.z[0]);
}

void ivl_sim_impulse(const ivl_sim_model_t *model, const ivl_sim_foot_t foot[IVL_SIM_LEGS], ivl_sim_kin_t *kin)
{
    const ivl_sim_leg_model_t *leg = &model->leg;
    ivl_sim_contact_t          contact;
    ivl_sim_state_t            s;
    kinematics_t               k;
    ivl_wide_t                 b[N] = {{0.0}, {0.0}, {0.0}, {0.0}, {0.0}, {0.0}}, r[IVL_SIM_LEGS], u[N], axial[IVL_SIM_LEGS];
    ivl_w3_t                   jump[IVL_SIM_LEGS], v_foot[IVL_SIM_LEGS];
    row_t                      rows[IVL_SIM_LEGS];
    memset(&contact, 0, sizeof contact);
    ivl_sim_contact_set(model, &contact, 0, foot);
    spread_contact(&contact);
    spread(kin, &s);
    kinematics(model, &s, &k);
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        // the jump of a held foot is known: all of its velocity, or the part along the normal if it slides
        const double stuck = (foot[i] == IVL_SIM_FOOT_STUCK) ? 1.0 : 0.0;
        v_foot[i] = ivl_wrot_apply_inverse(&k.R_WB, s.v_foot_W_mps[i]);
        jump[i] = ivl_w3_plus(ivl_w3_scale(ivl_wide(-stuck), v_foot[i]), -contact.sliding[i] * ivl_w3_dot(k.up, v_foot[i]), k.up);
        const ivl_w3_t at_hip = ivl_w3_scale(ivl_wide(leg->mass_cross_kg), jump[i]);
        subtract_wrench(b, at_hip, ivl_w3_cross_from_d3(leg->hip_B_m[i], at_hip));
        rows[i] = constraint_row(model, &contact, &k, i);
        r[i] = ivl_w3_dot(k.n[i], ivl_w3_add(k.v_rod[i], jump[i]));
    }
    inverse_while_sliding(model, &contact, &k.up, contact.inverse_mass6);
    solve_constrained(contact.inverse_mass6, (const row_t *)rows, b, r, u, axial);
    const ivl_w3_t dv = {u[0], u[1], u[2]}, dw = {u[3], u[4], u[5]};
    s.v_WB_mps = ivl_w3_add(s.v_WB_mps, ivl_wrot_apply(&k.R_WB, dv));
    s.w_B_radps = ivl_w3_add(s.w_B_radps, dw);
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const ivl_w3_t dv_hip = ivl_w3_add(dv, ivl_w3_cross_d3(dw, leg->hip_B_m[i]));
        const ivl_w3_t push = ivl_w3_plus(ivl_w3_scale(axial[i], k.n[i]), ivl_wide(leg->mass_cross_kg), dv_hip);
        const ivl_w3_t yield = ivl_w3_scale(-contact.inverse_mass[i], along_ceiling(contact.sliding[i], k.up, push));
        s.v_foot_W_mps[i] = ivl_wrot_apply(&k.R_WB, ivl_w3_add(v_foot[i], ivl_w3_add(jump[i], yield)));
    }
    ivl_sim_lane_get(&s, 0, kin);
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        // exactly at rest, not up to rounding
        kin->v_foot_W_mps[i][0] = (foot[i] == IVL_SIM_FOOT_STUCK) ? 0.0 : kin->v_foot_W_mps[i][0];
        kin->v_foot_W_mps[i][1] = (foot[i] == IVL_SIM_FOOT_STUCK) ? 0.0 : kin->v_foot_W_mps[i][1];
        kin->v_foot_W_mps[i][2] = (foot[i] != IVL_SIM_FOOT_FREE) ? 0.0 : kin->v_foot_W_mps[i][2];
    }
}

static double plate_energy(const ivl_sim_model_t *model, ivl_d3_t up, double height_m, int p)
{
    double energy = 0.0;
    for (int i = 0; i < IVL_SIM_CORNERS; i++)
    {
        const ivl_d3_t x = model->plate[p].corner_B_m[i];
        const double   depth = height_m + ivl_d3_dot(up, x) - model->raw.world_ceiling_height_m;
        energy += (depth > 0.0) ? 0.5 * model->raw.plate_stiffness_Npm * depth * depth : 0.0;
    }
    return energy;
}

double ivl_sim_energy(const ivl_sim_model_t *model, const ivl_sim_kin_t *kin)
{
    const ivl_sim_params_t    *raw = &model->raw;
    const ivl_sim_leg_model_t *leg = &model->leg;
    ivl_sim_state_t            s;
    kinematics_t               k;
    spread(kin, &s);
    kinematics(model, &s, &k);
    const ivl_d3_t v = first(k.v), w = first(k.w), up = first(k.up);
    double         energy =
        0.5 * raw->body_mass_kg * ivl_d3_dot(v, v) +
        0.5 * (raw->body_inertia_xx_kgm2 * w.x * w.x + raw->body_inertia_yy_kgm2 * w.y * w.y + raw->body_inertia_zz_kgm2 * w.z * w.z) +
        raw->body_mass_kg * raw->world_gravity_mps2 * kin->p_WB_m[2];
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        ivl_angle_t folded[2];
        ivl_wide_t  t[2], deflection[2];
        (void)hinge(leg, i, k.n[i], folded, t);
        ivl_wide_unfold(folded, t, deflection, 2);
        const ivl_d3_t v_hip = ivl_d3_add(v, ivl_d3_cross(w, leg->hip_B_m[i]));
        const ivl_d3_t v_foot = ivl_d3_add(v_hip, first(k.v_rod[i]));
        const double   hip_height = kin->p_WB_m[2] + ivl_d3_dot(leg->hip_B_m[i], up);
        energy += 0.5 * leg->mass_hip_kg * ivl_d3_dot(v_hip, v_hip) + leg->mass_cross_kg * ivl_d3_dot(v_hip, v_foot) +
                  0.5 * leg->mass_foot_kg * ivl_d3_dot(v_foot, v_foot) +
                  0.5 * raw->leg_stiffness_Nmprad * (deflection[0][0] * deflection[0][0] + deflection[1][0] * deflection[1][0]) +
                  raw->world_gravity_mps2 * (leg->weight_hip_kg * hip_height + leg->weight_foot_kg * kin->p_foot_W_m[i][2]);
    }
    return energy + plate_energy(model, up, kin->p_WB_m[2], IVL_SIM_PROP_PLATE) +
           plate_energy(model, up, kin->p_WB_m[2], IVL_SIM_BASE_PLATE);
}

void ivl_sim_momentum(const ivl_sim_model_t *model, const ivl_sim_kin_t *kin, double linear[3], double angular[3])
{
    const ivl_sim_params_t    *raw = &model->raw;
    const ivl_sim_leg_model_t *leg = &model->leg;
    const ivl_rot_t            R = ivl_rot_from_quat(kin->q_WB);
    const ivl_d3_t             p = ivl_d3_load(kin->p_WB_m), v = ivl_d3_load(kin->v_WB_mps), w = ivl_d3_load(kin->w_B_radps);
    const ivl_d3_t spin = ivl_d3(raw->body_inertia_xx_kgm2 * w.x, raw->body_inertia_yy_kgm2 * w.y, raw->body_inertia_zz_kgm2 * w.z);
    ivl_d3_t       l = ivl_d3_scale(raw->body_mass_kg, v);
    ivl_d3_t       a = ivl_d3_add(ivl_rot_apply(&R, spin), ivl_d3_cross(p, l));
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const ivl_d3_t hip = leg->hip_B_m[i];
        const ivl_d3_t v_hip = ivl_d3_add(v, ivl_rot_apply(&R, ivl_d3_cross(w, hip)));
        const ivl_d3_t p_hip = ivl_d3_add(p, ivl_rot_apply(&R, hip));
        const ivl_d3_t v_foot = ivl_d3_load(kin->v_foot_W_mps[i]), p_foot = ivl_d3_load(kin->p_foot_W_m[i]);
        const ivl_d3_t l_hip = ivl_d3_add(ivl_d3_scale(leg->mass_hip_kg, v_hip), ivl_d3_scale(leg->mass_cross_kg, v_foot));
        const ivl_d3_t l_foot = ivl_d3_add(ivl_d3_scale(leg->mass_cross_kg, v_hip), ivl_d3_scale(leg->mass_foot_kg, v_foot));
        l = ivl_d3_add(l, ivl_d3_add(l_hip, l_foot));
        a = ivl_d3_add(a, ivl_d3_add(ivl_d3_cross(p_hip, l_hip), ivl_d3_cross(p_foot, l_foot)));
    }
    ivl_d3_store(linear, l);
    ivl_d3_store(angular, a);
}

double ivl_sim_plate_top(const ivl_sim_plate_t *plate, ivl_d3_t up)
{
    return fabs(up.x) * plate->half_m[0] + fabs(up.y) * plate->half_m[1] + fabs(up.z) * plate->half_m[2] + up.z * plate->center_z_m;
}
