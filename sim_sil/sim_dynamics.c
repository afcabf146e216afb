#include "sim_dynamics.h"

// Stabilisation of the length constraints: their error decays at this rate.  It only removes what truncation and rounding
// leave (below 1 um); the motion does not depend on it.                                            [MODEL eq. 4.7]
static const double STABILISATION_PER_S = 150.0;

// Compliance of a rod, m/(N s^2) in the units of the constraint's matrix.  Four parallel legs hold the body redundantly;
// this makes their forces unique.  With the rate above it equals an axial stiffness of 2e7 N/m.
static const double ROD_COMPLIANCE_PER_KG = 1.0e-3;

// Near +-90 degrees sideways the first hinge's axis falls into the rod (gimbal lock of the universal joint): its lever arm
// cos(beta) is kept above this value.
static const double COS_SIDEWAYS_MIN = 0.05;

/// Positions and velocities of one evaluation, in body axes; legs in lanes.
typedef struct
{
    ivl_rot_t R_WB;
    ivl_d3_t up;     ///< the world's z axis
    ivl_d3_t v, w;   ///< of the body
    ivl_l3_t rod;    ///< hip to foot
    ivl_l3_t n;      ///< rod / length
    ivl_l3_t v_hip, v_foot, v_rod; ///< v_rod = v_foot - v_hip
} kinematics_t;

/// The unknowns of one linear system: body wrench or twist (6), and a multiplier a leg.
typedef struct
{
    ivl_l3_t g;         ///< direction of the multiplier at the hip
    ivl_l3_t hip_x_g;   ///< its moment about the body origin
    ivl_v4_t compliance;
} constraint_t;

IVL_SIM_INLINE kinematics_t kinematics(const ivl_sim_model_t *model, const ivl_sim_kin_t *s)
{
    const ivl_l3_t hip = model->leg.hip_B_m;
    kinematics_t k;
    k.R_WB = ivl_rot_from_quat(s->q_WB);
    k.up = k.R_WB.row[2];
    k.w = ivl_d3_load(s->w_B_radps);
    k.v = ivl_rot_apply_inverse(&k.R_WB, ivl_d3_load(s->v_WB_mps));
    const ivl_l3_t p_foot = ivl_l3_sub(ivl_l3_load(s->p_foot_W_m), ivl_l3_set(ivl_d3_load(s->p_WB_m)));
    k.rod = ivl_l3_sub(ivl_rot_apply_inverse_l3(&k.R_WB, p_foot), hip);
    k.n = ivl_l3_scale(ivl_v4_set(1.0 / model->raw.leg_length_m), k.rod);
    k.v_hip = ivl_l3_add(ivl_l3_set(k.v), ivl_l3_cross(ivl_l3_set(k.w), hip));
    k.v_foot = ivl_rot_apply_inverse_l3(&k.R_WB, ivl_l3_load(s->v_foot_W_mps));
    k.v_rod = ivl_l3_sub(k.v_foot, k.v_hip);
    return k;
}

/// Angles of the hip's two hinges and the directions in which they move the rod.               [MODEL eq. 3.2]
typedef struct
{
    ivl_v4_t alpha, beta; ///< deflection in the leg's plane, and sideways
    ivl_l3_t e_alpha, e_beta;
    ivl_v4_t inv_cos_beta;
} hinge_t;

IVL_SIM_INLINE hinge_t hinge(const ivl_sim_leg_model_t *leg, ivl_l3_t n)
{
    const ivl_v4_t c = ivl_l3_dot(n, leg->rest_B);
    const ivl_v4_t s = ivl_l3_dot(n, leg->inplane_B);
    const ivl_v4_t t = ivl_l3_dot(n, leg->sideways_B);
    const ivl_v4_t root = ivl_v4_sqrt(c * c + s * s);
    const ivl_v4_t floor_cos = ivl_v4_set(COS_SIDEWAYS_MIN);
    const ivl_v4_t inv = 1.0 / ivl_v4_select(root > floor_cos, root, floor_cos);
    hinge_t h;
    h.alpha = ivl_v4_atan2(s, c);
    h.beta = ivl_v4_atan2(t, root);
    h.inv_cos_beta = inv;
    const ivl_v4_t ca = c * inv, sa = s * inv;
    h.e_alpha = ivl_l3_sub(ivl_l3_scale(ca, leg->inplane_B), ivl_l3_scale(sa, leg->rest_B));
    h.e_beta = ivl_l3_sub(ivl_l3_scale(root, leg->sideways_B),
                          ivl_l3_scale(t, ivl_l3_add(ivl_l3_scale(ca, leg->rest_B), ivl_l3_scale(sa, leg->inplane_B))));
    return h;
}

/// Force of the hip's springs and dampers on the foot; the rod's hip end gets the opposite, the body the opposite couple.
/// [MODEL eq. 3.4]
IVL_SIM_INLINE ivl_l3_t hip_couple(const ivl_sim_model_t *model, const kinematics_t *k)
{
    const double k_N = model->raw.leg_stiffness_Nmprad, c_N = model->raw.leg_damping_Nmsprad;
    const ivl_v4_t inv_length = ivl_v4_set(1.0 / model->raw.leg_length_m);
    const hinge_t h = hinge(&model->leg, k->n);
    const ivl_l3_t n_rate = ivl_l3_scale(inv_length, ivl_l3_sub(k->v_rod, ivl_l3_cross(ivl_l3_set(k->w), k->rod)));
    const ivl_v4_t alpha_rate = ivl_l3_dot(n_rate, h.e_alpha) * h.inv_cos_beta;
    const ivl_v4_t beta_rate = ivl_l3_dot(n_rate, h.e_beta);
    const ivl_v4_t torque_alpha = -(k_N * h.alpha + c_N * alpha_rate);
    const ivl_v4_t torque_beta = -(k_N * h.beta + c_N * beta_rate);
    return ivl_l3_scale(inv_length, ivl_l3_add(ivl_l3_scale(torque_alpha * h.inv_cos_beta, h.e_alpha),
                                               ivl_l3_scale(torque_beta, h.e_beta)));
}

/// Without the part along the ceiling's normal, for a foot that slides.
IVL_SIM_INLINE ivl_l3_t along_ceiling(ivl_v4_t sliding, ivl_l3_t up, ivl_l3_t a)
{
    return ivl_l3_sub(a, ivl_l3_scale(sliding * ivl_l3_dot(up, a), up));
}

IVL_SIM_INLINE constraint_t constraint(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact,
                                       const kinematics_t *k)
{
    const ivl_v4_t inv_mass = ivl_v4_load(contact->inverse_mass);
    const ivl_l3_t pn = along_ceiling(ivl_v4_load(contact->sliding), ivl_l3_set(k->up), k->n);
    constraint_t c;
    c.g = ivl_l3_add(k->n, ivl_l3_scale(model->leg.mass_cross_kg * inv_mass, pn));
    c.hip_x_g = ivl_l3_cross(model->leg.hip_B_m, c.g);
    c.compliance = inv_mass * ivl_l3_dot(k->n, pn) + ROD_COMPLIANCE_PER_KG;
    return c;
}

/// Solves the symmetric positive definite 4 x 4 system a x = b, L D L^T.
IVL_SIM_INLINE ivl_v4_t solve4(const ivl_v4_t a[4], ivl_v4_t b)
{
    const double d0 = 1.0 / a[0][0];
    const double l10 = a[0][1] * d0, l20 = a[0][2] * d0, l30 = a[0][3] * d0;
    const double d1 = 1.0 / (a[1][1] - l10 * a[0][1]);
    const double u21 = a[1][2] - l10 * a[0][2], u31 = a[1][3] - l10 * a[0][3];
    const double l21 = u21 * d1, l31 = u31 * d1;
    const double d2 = 1.0 / (a[2][2] - l20 * a[0][2] - l21 * u21);
    const double u32 = a[2][3] - l20 * a[0][3] - l21 * u31;
    const double l32 = u32 * d2;
    const double d3 = 1.0 / (a[3][3] - l30 * a[0][3] - l31 * u31 - l32 * u32);
    const double y0 = b[0];
    const double y1 = b[1] - l10 * y0;
    const double y2 = b[2] - l20 * y0 - l21 * y1;
    const double y3 = b[3] - l30 * y0 - l31 * y1 - l32 * y2;
    const double x3 = y3 * d3;
    const double x2 = y2 * d2 - l32 * x3;
    const double x1 = y1 * d1 - l21 * x2 - l31 * x3;
    const double x0 = y0 * d0 - l10 * x1 - l20 * x2 - l30 * x3;
    return (ivl_v4_t){x0, x1, x2, x3};
}

/// Solves  M u = b + J^T x,  J u + compliance x = r  for the twist u and the multipliers x.      [MODEL eq. 4.10]
IVL_SIM_INLINE void solve_constrained(const double inv_m[6][6], const constraint_t *c, const double b[6], ivl_v4_t r,
                                      double u[6], ivl_v4_t *x)
{
    const ivl_v4_t J[6] = {c->g.x, c->g.y, c->g.z, c->hip_x_g.x, c->hip_x_g.y, c->hip_x_g.z};
    ivl_v4_t W[6];
    ivl_v4_t A[4] = {{0}, {0}, {0}, {0}};
    for (int i = 0; i < 6; i++)
    {
        W[i] = inv_m[i][0] * J[0];
        for (int j = 1; j < 6; j++)
        {
            W[i] += inv_m[i][j] * J[j];
        }
    }
    for (int leg = 0; leg < 4; leg++)
    {
        for (int i = 0; i < 6; i++)
        {
            A[leg] += W[i][leg] * J[i];
        }
        A[leg][leg] += c->compliance[leg];
    }
    for (int i = 0; i < 6; i++)
    {
        r -= W[i] * b[i];
    }
    *x = solve4((const ivl_v4_t *)A, r);
    for (int i = 0; i < 6; i++)
    {
        double free = inv_m[i][0] * b[0];
        for (int j = 1; j < 6; j++)
        {
            free += inv_m[i][j] * b[j];
        }
        u[i] = free + ivl_v4_sum(W[i] * *x);
    }
}

/// Inverse of a symmetric positive definite 6 x 6 matrix, by Gauss-Jordan elimination (no pivoting is needed).
static void invert6(const double a[6][6], double inverse[6][6])
{
    double m[6][12];
    for (int i = 0; i < 6; i++)
    {
        for (int j = 0; j < 6; j++)
        {
            m[i][j] = a[i][j];
            m[i][6 + j] = (i == j) ? 1.0 : 0.0;
        }
    }
    for (int p = 0; p < 6; p++)
    {
        const double inv = 1.0 / m[p][p];
        for (int j = 0; j < 12; j++)
        {
            m[p][j] *= inv;
        }
        for (int i = 0; i < 6; i++)
        {
            const double f = (i == p) ? 0.0 : m[i][p];
            for (int j = 0; j < 12; j++)
            {
                m[i][j] -= f * m[p][j];
            }
        }
    }
    for (int i = 0; i < 6; i++)
    {
        for (int j = 0; j < 6; j++)
        {
            inverse[i][j] = m[i][6 + j];
        }
    }
}

/// Adds the point mass mu (a a^T) at x: mu times the square of the velocity along the unit vector a.
static void add_mass_along(double m[6][6], double mu, ivl_d3_t x, ivl_d3_t a)
{
    const ivl_d3_t moment = ivl_d3_cross(x, a);
    const double row[6] = {a.x, a.y, a.z, moment.x, moment.y, moment.z};
    for (int i = 0; i < 6; i++)
    {
        for (int j = 0; j < 6; j++)
        {
            m[i][j] += mu * row[i] * row[j];
        }
    }
}

/// Mass matrix of the body and of the hip ends of the legs.                                     [MODEL eq. 4.8]
static void build_mass(const ivl_sim_model_t *model, ivl_sim_contact_t *contact)
{
    const ivl_sim_params_t *raw = &model->raw;
    const double diagonal[6] = {raw->body_mass_kg,         raw->body_mass_kg,         raw->body_mass_kg,
                                raw->body_inertia_xx_kgm2, raw->body_inertia_yy_kgm2, raw->body_inertia_zz_kgm2};
    const ivl_sim_leg_model_t *leg = &model->leg;
    memset(contact->mass, 0, sizeof contact->mass);
    for (int i = 0; i < 6; i++)
    {
        contact->mass[i][i] = diagonal[i];
    }
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const double mu = leg->mass_hip_kg - leg->mass_cross_kg * leg->mass_cross_kg * contact->inverse_mass[i];
        const ivl_d3_t hip = ivl_l3_lane(leg->hip_B_m, i);
        add_mass_along(contact->mass, mu, hip, ivl_d3(1.0, 0.0, 0.0));
        add_mass_along(contact->mass, mu, hip, ivl_d3(0.0, 1.0, 0.0));
        add_mass_along(contact->mass, mu, hip, ivl_d3(0.0, 0.0, 1.0));
    }
    invert6((const double(*)[6])contact->mass, contact->inverse_mass6);
}

void ivl_sim_contact_set(const ivl_sim_model_t *model, ivl_sim_contact_t *contact, int leg, ivl_sim_foot_t foot)
{
    contact->foot[leg] = foot;
    contact->inverse_mass[leg] = (foot == IVL_SIM_FOOT_STUCK) ? 0.0 : 1.0 / model->leg.mass_foot_kg;
    contact->sliding[leg] = (foot == IVL_SIM_FOOT_SLIDING) ? 1.0 : 0.0;
    contact->any_sliding = false;
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        contact->any_sliding = contact->any_sliding || (contact->foot[i] == IVL_SIM_FOOT_SLIDING);
    }
    build_mass(model, contact);
}

void ivl_sim_contact_init(const ivl_sim_model_t *model, ivl_sim_contact_t *contact)
{
    memset(contact, 0, sizeof *contact);
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        contact->inverse_mass[i] = 1.0 / model->leg.mass_foot_kg;
    }
    build_mass(model, contact);
}

/// A sliding foot does not yield along the ceiling's normal: the hip carries more mass in that direction, which turns
/// with the body, so that the matrix must be rebuilt at each evaluation.
static void mass_while_sliding(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact, ivl_d3_t up,
                               double inverse[6][6])
{
    const ivl_sim_leg_model_t *leg = &model->leg;
    double m[6][6];
    memcpy(m, contact->mass, sizeof m);
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const double mu = leg->mass_cross_kg * leg->mass_cross_kg * contact->inverse_mass[i] * contact->sliding[i];
        add_mass_along(m, mu, ivl_l3_lane(leg->hip_B_m, i), up);
    }
    invert6((const double(*)[6])m, inverse);
}

/// Height of the highest point of a plate above the body origin.
IVL_SIM_INLINE double plate_top(const ivl_sim_plate_t *plate, ivl_d3_t up)
{
    return fabs(up.x) * plate->half_m[0] + fabs(up.y) * plate->half_m[1] + fabs(up.z) * plate->half_m[2] +
           up.z * plate->center_z_m;
}

/// Force and moment (body axes, about the body origin) of a plate's corners that press on the ceiling.
/// Hunt-Crossley normal force, regularised Coulomb friction.                                     [MODEL eq. 5.1, 5.2]
static void plate_force(const ivl_sim_model_t *model, const kinematics_t *k, double height_m, int index, double b[6])
{
    const ivl_sim_plate_t *plate = &model->plate[index];
    const ivl_sim_params_t *raw = &model->raw;
    for (int i = 0; i < IVL_SIM_CORNERS; i++)
    {
        const ivl_d3_t x = ivl_d3(plate->corner_B_m[0][i], plate->corner_B_m[1][i], plate->corner_B_m[2][i]);
        const double depth = height_m + ivl_d3_dot(k->up, x) - raw->world_ceiling_height_m;
        if (depth > 0.0)
        {
            const ivl_d3_t v = ivl_d3_add(k->v, ivl_d3_cross(k->w, x));
            const double depth_rate = ivl_d3_dot(k->up, v);
            const double press = raw->plate_stiffness_Npm * depth * (1.0 + raw->plate_damping_spm * depth_rate);
            const double normal = (press > 0.0) ? press : 0.0;
            const ivl_d3_t slip = ivl_d3_sub(v, ivl_d3_scale(depth_rate, k->up));
            const double slow = raw->plate_slip_speed_mps;
            const double drag = raw->plate_friction_norm * normal / sqrt(ivl_d3_dot(slip, slip) + slow * slow);
            const ivl_d3_t f = ivl_d3_sub(ivl_d3_scale(-normal, k->up), ivl_d3_scale(drag, slip));
            const ivl_d3_t m = ivl_d3_cross(x, f);
            const double wrench[6] = {f.x, f.y, f.z, m.x, m.y, m.z};
            for (int j = 0; j < 6; j++)
            {
                b[j] += wrench[j];
            }
        }
    }
}

/// What acts on the body except the legs: weight, rotors, drag, plates, gyroscopic moment.
IVL_SIM_INLINE void body_wrench(const ivl_sim_model_t *model, const ivl_sim_load_t *load, const kinematics_t *k,
                                const ivl_sim_kin_t *s, double b[6], ivl_sim_forces_t *forces)
{
    const ivl_sim_params_t *raw = &model->raw;
    const double weight = raw->body_mass_kg * raw->world_gravity_mps2;
    b[0] = -weight * k->up.x - raw->aero_drag_xy_Nspm * k->v.x;
    b[1] = -weight * k->up.y - raw->aero_drag_xy_Nspm * k->v.y;
    b[2] = -weight * k->up.z - raw->aero_drag_z_Nspm * k->v.z + load->thrust_N;
    b[3] = load->torque_B_Nm[0] - (raw->body_inertia_zz_kgm2 - raw->body_inertia_yy_kgm2) * k->w.y * k->w.z;
    b[4] = load->torque_B_Nm[1] - (raw->body_inertia_xx_kgm2 - raw->body_inertia_zz_kgm2) * k->w.z * k->w.x;
    b[5] = load->torque_B_Nm[2] - (raw->body_inertia_yy_kgm2 - raw->body_inertia_xx_kgm2) * k->w.x * k->w.y;
    for (int i = 0; i < IVL_SIM_PLATES; i++)
    {
        forces->plate_touches[i] = s->p_WB_m[2] + plate_top(&model->plate[i], k->up) > raw->world_ceiling_height_m;
        if (forces->plate_touches[i])
        {
            plate_force(model, k, s->p_WB_m[2], i, b);
        }
    }
}

IVL_SIM_INLINE void subtract_wrench(double b[6], ivl_d3_t force, ivl_d3_t moment)
{
    b[0] -= force.x;
    b[1] -= force.y;
    b[2] -= force.z;
    b[3] -= moment.x;
    b[4] -= moment.y;
    b[5] -= moment.z;
}

/// dq/dt = q (0, w) / 2
IVL_SIM_INLINE void quaternion_rate(const double q[4], ivl_d3_t w, double rate[4])
{
    rate[0] = 0.5 * (q[3] * w.x + q[1] * w.z - q[2] * w.y);
    rate[1] = 0.5 * (q[3] * w.y + q[2] * w.x - q[0] * w.z);
    rate[2] = 0.5 * (q[3] * w.z + q[0] * w.y - q[1] * w.x);
    rate[3] = -0.5 * (q[0] * w.x + q[1] * w.y + q[2] * w.z);
}

IVL_SIM_INLINE void rate_of(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact, const ivl_sim_load_t *load,
                            const ivl_sim_kin_t *s, ivl_sim_kin_t *rate, ivl_sim_forces_t *forces)
{
    const ivl_sim_leg_model_t *leg = &model->leg;
    const double length = model->raw.leg_length_m, gravity = model->raw.world_gravity_mps2;
    const kinematics_t k = kinematics(model, s);
    const ivl_l3_t up = ivl_l3_set(k.up), w = ivl_l3_set(k.w), hip = leg->hip_B_m;
    const ivl_v4_t inv_mass = ivl_v4_load(contact->inverse_mass), sliding = ivl_v4_load(contact->sliding);

    // forces on the nodes of each rod: hip springs, friction of a stuck foot's joint, weight
    const ivl_l3_t couple = hip_couple(model, &k);
    const ivl_v4_t held = ivl_v4_select(inv_mass > 0.0, ivl_v4_set(0.0), ivl_v4_set(1.0));
    const ivl_v4_t joint = held * (model->raw.leg_foot_damping_Nmsprad / (length * length));
    const ivl_l3_t pair = ivl_l3_sub(couple, ivl_l3_scale(joint, k.v_rod));
    const ivl_l3_t f_foot = ivl_l3_sub(pair, ivl_l3_scale(ivl_v4_set(leg->weight_foot_kg * gravity), up));

    // what the hips would feel if neither the body nor the constraints accelerated them
    const ivl_l3_t centripetal = ivl_l3_cross(w, ivl_l3_cross(w, hip));
    const ivl_l3_t yield = ivl_l3_scale(
        leg->mass_cross_kg * inv_mass,
        along_ceiling(sliding, up, ivl_l3_sub(f_foot, ivl_l3_scale(ivl_v4_set(leg->mass_cross_kg), centripetal))));
    const ivl_l3_t at_hip =
        ivl_l3_add(ivl_l3_add(ivl_l3_scale(ivl_v4_set(leg->mass_hip_kg), centripetal), yield),
                   ivl_l3_add(pair, ivl_l3_scale(ivl_v4_set(leg->weight_hip_kg * gravity), up)));
    double b[6];
    body_wrench(model, load, &k, s, b, forces);
    subtract_wrench(b, ivl_l3_sum(at_hip),
                    ivl_l3_sum(ivl_l3_add(ivl_l3_cross(hip, at_hip), ivl_l3_cross(k.rod, couple))));

    // length constraints: n.(a_foot - a_hip) = -|v_rod|^2 / L - stabilisation
    const constraint_t c = constraint(model, contact, &k);
    const double sigma = STABILISATION_PER_S;
    const ivl_v4_t curvature = ivl_l3_dot(k.v_rod, k.v_rod) * (1.0 / length) + 2.0 * sigma * ivl_l3_dot(k.n, k.v_rod) +
                               (0.5 * sigma * sigma / length) * (ivl_l3_dot(k.rod, k.rod) - length * length);
    const ivl_v4_t target = curvature + inv_mass * ivl_l3_dot(k.n, along_ceiling(sliding, up, f_foot)) -
                            ivl_l3_dot(c.g, centripetal);
    double u[6];
    ivl_v4_t axial;
    if (contact->any_sliding)
    {
        double inverse[6][6];
        mass_while_sliding(model, contact, k.up, inverse);
        solve_constrained((const double(*)[6])inverse, &c, b, target, u, &axial);
    }
    else
    {
        solve_constrained(contact->inverse_mass6, &c, b, target, u, &axial);
    }

    // back to the nodes
    const ivl_l3_t a_hip = ivl_l3_add(ivl_l3_add(ivl_l3_set(ivl_d3(u[0], u[1], u[2])), centripetal),
                                      ivl_l3_cross(ivl_l3_set(ivl_d3(u[3], u[4], u[5])), hip));
    const ivl_l3_t net = ivl_l3_sub(ivl_l3_sub(f_foot, ivl_l3_scale(axial, k.n)),
                                    ivl_l3_scale(ivl_v4_set(leg->mass_cross_kg), a_hip));
    const ivl_l3_t a_foot = ivl_l3_scale(inv_mass, along_ceiling(sliding, up, net));
    const ivl_d3_t a = ivl_rot_apply(&k.R_WB, ivl_d3(u[0], u[1], u[2]));
    memcpy(rate->p_WB_m, s->v_WB_mps, sizeof rate->p_WB_m);
    rate->pitch_rad = -k.w.y;
    ivl_d3_store(rate->v_WB_mps, a);
    rate->pad_v = 0.0;
    quaternion_rate(s->q_WB, k.w, rate->q_WB);
    ivl_d3_store(rate->w_B_radps, ivl_d3(u[3], u[4], u[5]));
    rate->pad_w = 0.0;
    memcpy(rate->p_foot_W_m, s->v_foot_W_mps, sizeof rate->p_foot_W_m);
    ivl_l3_store(rate->v_foot_W_mps, ivl_rot_apply_l3(&k.R_WB, a_foot));
    ivl_d3_store(forces->a_WB_mps2, a);
    ivl_v4_store(forces->pull_N, -ivl_l3_dot(up, net));
}

enum
{
    STATE_SIZE = sizeof(ivl_sim_kin_t) / sizeof(double)
};

IVL_SIM_INLINE void advance(const ivl_sim_kin_t *s, double dt, const ivl_sim_kin_t *rate, ivl_sim_kin_t *next)
{
    const double *x = (const double *)s, *r = (const double *)rate;
    double *y = (double *)next;
    for (int i = 0; i < STATE_SIZE; i++)
    {
        y[i] = x[i] + dt * r[i];
    }
}

IVL_SIM_INLINE void normalize(double q[4])
{
    const double s = 1.0 / sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (int i = 0; i < 4; i++)
    {
        q[i] *= s;
    }
}

IVL_SIM_INLINE void rk4_of(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact, const ivl_sim_load_t *load,
                           const ivl_sim_kin_t *rate, double dt, const ivl_sim_kin_t *s, ivl_sim_kin_t *next)
{
    ivl_sim_kin_t stage, r[3];
    ivl_sim_forces_t unused;
    advance(s, 0.5 * dt, rate, &stage);
    for (int i = 0; i < 3; i++)
    {
        rate_of(model, contact, load, &stage, &r[i], &unused);
        advance(s, (i == 0) ? 0.5 * dt : dt, &r[i], &stage);
    }
    const double *x = (const double *)s, *r0 = (const double *)rate, *r1 = (const double *)&r[0];
    const double *r2 = (const double *)&r[1], *r3 = (const double *)&r[2];
    double *y = (double *)next;
    for (int i = 0; i < STATE_SIZE; i++)
    {
        y[i] = x[i] + dt * (1.0 / 6.0) * (r0[i] + 2.0 * (r1[i] + r2[i]) + r3[i]);
    }
    normalize(next->q_WB);
}

// The same source is compiled twice, for plain x86-64 (or any other machine) and with 256-bit registers.  Both give the
// same bits: lanes never mix, and AVX2 without FMA rounds as SSE2 does.
#if defined(__x86_64__)
#define IVL_SIM_HAS_AVX2 1

__attribute__((target("avx2"))) static void rate_avx2(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact,
                                                      const ivl_sim_load_t *load, const ivl_sim_kin_t *state,
                                                      ivl_sim_kin_t *rate, ivl_sim_forces_t *forces)
{
    rate_of(model, contact, load, state, rate, forces);
}

__attribute__((target("avx2"))) static void rk4_avx2(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact,
                                                     const ivl_sim_load_t *load, const ivl_sim_kin_t *rate, double dt_s,
                                                     const ivl_sim_kin_t *state, ivl_sim_kin_t *next)
{
    rk4_of(model, contact, load, rate, dt_s, state, next);
}
#else
#define IVL_SIM_HAS_AVX2 0
#endif

void ivl_sim_rate(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact, const ivl_sim_load_t *load,
                  const ivl_sim_kin_t *state, ivl_sim_kin_t *rate, ivl_sim_forces_t *forces)
{
#if IVL_SIM_HAS_AVX2
    if (__builtin_cpu_supports("avx2"))
    {
        rate_avx2(model, contact, load, state, rate, forces);
        return;
    }
#endif
    rate_of(model, contact, load, state, rate, forces);
}

void ivl_sim_rk4(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact, const ivl_sim_load_t *load,
                 const ivl_sim_kin_t *rate, double dt_s, const ivl_sim_kin_t *state, ivl_sim_kin_t *next)
{
#if IVL_SIM_HAS_AVX2
    if (__builtin_cpu_supports("avx2"))
    {
        rk4_avx2(model, contact, load, rate, dt_s, state, next);
        return;
    }
#endif
    rk4_of(model, contact, load, rate, dt_s, state, next);
}

void ivl_sim_impulse(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact, ivl_sim_kin_t *s)
{
    const ivl_sim_leg_model_t *leg = &model->leg;
    const kinematics_t k = kinematics(model, s);
    const ivl_l3_t up = ivl_l3_set(k.up);
    const ivl_v4_t inv_mass = ivl_v4_load(contact->inverse_mass), sliding = ivl_v4_load(contact->sliding);

    // the jump of a held foot is known: all of its velocity, or the part along the normal if it slides
    const ivl_v4_t stuck = ivl_v4_select(inv_mass > 0.0, ivl_v4_set(0.0), ivl_v4_set(1.0));
    const ivl_l3_t jump = ivl_l3_sub(ivl_l3_scale(-stuck, k.v_foot),
                                     ivl_l3_scale(sliding * ivl_l3_dot(up, k.v_foot), up));
    const ivl_l3_t at_hip = ivl_l3_scale(ivl_v4_set(leg->mass_cross_kg), jump);
    double b[6] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0}, inverse[6][6], u[6];
    subtract_wrench(b, ivl_l3_sum(at_hip), ivl_l3_sum(ivl_l3_cross(leg->hip_B_m, at_hip)));
    const constraint_t c = constraint(model, contact, &k);
    ivl_v4_t axial;
    mass_while_sliding(model, contact, k.up, inverse);
    solve_constrained((const double(*)[6])inverse, &c, b, ivl_l3_dot(k.n, ivl_l3_add(k.v_rod, jump)), u, &axial);

    const ivl_l3_t dv_hip = ivl_l3_add(ivl_l3_set(ivl_d3(u[0], u[1], u[2])),
                                       ivl_l3_cross(ivl_l3_set(ivl_d3(u[3], u[4], u[5])), leg->hip_B_m));
    const ivl_l3_t push = ivl_l3_add(ivl_l3_scale(axial, k.n), ivl_l3_scale(ivl_v4_set(leg->mass_cross_kg), dv_hip));
    const ivl_l3_t dv_foot = ivl_l3_sub(jump, ivl_l3_scale(inv_mass, along_ceiling(sliding, up, push)));
    const ivl_d3_t v = ivl_rot_apply(&k.R_WB, ivl_d3_add(k.v, ivl_d3(u[0], u[1], u[2])));
    ivl_d3_store(s->v_WB_mps, v);
    ivl_d3_store(s->w_B_radps, ivl_d3_add(k.w, ivl_d3(u[3], u[4], u[5])));
    ivl_l3_store(s->v_foot_W_mps, ivl_rot_apply_l3(&k.R_WB, ivl_l3_add(k.v_foot, dv_foot)));
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        if (contact->foot[i] == IVL_SIM_FOOT_STUCK)
        {
            s->v_foot_W_mps[0][i] = s->v_foot_W_mps[1][i] = s->v_foot_W_mps[2][i] = 0.0;
        }
        else if (contact->foot[i] == IVL_SIM_FOOT_SLIDING)
        {
            s->v_foot_W_mps[2][i] = 0.0;
        }
    }
}

static double plate_energy(const ivl_sim_model_t *model, const kinematics_t *k, double height_m, int index)
{
    const ivl_sim_plate_t *plate = &model->plate[index];
    double energy = 0.0;
    for (int i = 0; i < IVL_SIM_CORNERS; i++)
    {
        const ivl_d3_t x = ivl_d3(plate->corner_B_m[0][i], plate->corner_B_m[1][i], plate->corner_B_m[2][i]);
        const double depth = height_m + ivl_d3_dot(k->up, x) - model->raw.world_ceiling_height_m;
        energy += (depth > 0.0) ? 0.5 * model->raw.plate_stiffness_Npm * depth * depth : 0.0;
    }
    return energy;
}

double ivl_sim_energy(const ivl_sim_model_t *model, const ivl_sim_kin_t *s)
{
    const ivl_sim_params_t *raw = &model->raw;
    const ivl_sim_leg_model_t *leg = &model->leg;
    const kinematics_t k = kinematics(model, s);
    const hinge_t h = hinge(leg, k.n);
    const double body = 0.5 * raw->body_mass_kg * ivl_d3_dot(k.v, k.v) +
                        0.5 * (raw->body_inertia_xx_kgm2 * k.w.x * k.w.x + raw->body_inertia_yy_kgm2 * k.w.y * k.w.y +
                               raw->body_inertia_zz_kgm2 * k.w.z * k.w.z);
    const ivl_v4_t rods = 0.5 * leg->mass_hip_kg * ivl_l3_dot(k.v_hip, k.v_hip) +
                          leg->mass_cross_kg * ivl_l3_dot(k.v_hip, k.v_foot) +
                          0.5 * leg->mass_foot_kg * ivl_l3_dot(k.v_foot, k.v_foot);
    const ivl_v4_t springs = 0.5 * raw->leg_stiffness_Nmprad * (h.alpha * h.alpha + h.beta * h.beta);
    const ivl_v4_t hip_height = s->p_WB_m[2] + ivl_l3_dot(leg->hip_B_m, ivl_l3_set(k.up));
    const ivl_v4_t weights = leg->weight_hip_kg * hip_height + leg->weight_foot_kg * ivl_v4_load(s->p_foot_W_m[2]);
    return body + ivl_v4_sum(rods + springs) +
           raw->world_gravity_mps2 * (raw->body_mass_kg * s->p_WB_m[2] + ivl_v4_sum(weights)) +
           plate_energy(model, &k, s->p_WB_m[2], IVL_SIM_PROP_PLATE) +
           plate_energy(model, &k, s->p_WB_m[2], IVL_SIM_BASE_PLATE);
}

void ivl_sim_momentum(const ivl_sim_model_t *model, const ivl_sim_kin_t *s, double linear[3], double angular[3])
{
    const ivl_sim_params_t *raw = &model->raw;
    const ivl_sim_leg_model_t *leg = &model->leg;
    const kinematics_t k = kinematics(model, s);
    const ivl_d3_t p = ivl_d3_load(s->p_WB_m);
    const ivl_d3_t mv = ivl_d3_scale(raw->body_mass_kg, ivl_d3_load(s->v_WB_mps));
    const ivl_d3_t spin = ivl_rot_apply(&k.R_WB, ivl_d3(raw->body_inertia_xx_kgm2 * k.w.x, raw->body_inertia_yy_kgm2 * k.w.y,
                                                        raw->body_inertia_zz_kgm2 * k.w.z));
    ivl_d3_t l = mv, a = ivl_d3_add(spin, ivl_d3_cross(p, mv));
    for (int i = 0; i < IVL_SIM_LEGS; i++)
    {
        const ivl_d3_t v_hip = ivl_rot_apply(&k.R_WB, ivl_l3_lane(k.v_hip, i));
        const ivl_d3_t p_hip = ivl_d3_add(p, ivl_rot_apply(&k.R_WB, ivl_l3_lane(leg->hip_B_m, i)));
        const ivl_d3_t v_foot = ivl_d3(s->v_foot_W_mps[0][i], s->v_foot_W_mps[1][i], s->v_foot_W_mps[2][i]);
        const ivl_d3_t p_foot = ivl_d3(s->p_foot_W_m[0][i], s->p_foot_W_m[1][i], s->p_foot_W_m[2][i]);
        const ivl_d3_t l_hip =
            ivl_d3_add(ivl_d3_scale(leg->mass_hip_kg, v_hip), ivl_d3_scale(leg->mass_cross_kg, v_foot));
        const ivl_d3_t l_foot =
            ivl_d3_add(ivl_d3_scale(leg->mass_cross_kg, v_hip), ivl_d3_scale(leg->mass_foot_kg, v_foot));
        l = ivl_d3_add(l, ivl_d3_add(l_hip, l_foot));
        a = ivl_d3_add(a, ivl_d3_add(ivl_d3_cross(p_hip, l_hip), ivl_d3_cross(p_foot, l_foot)));
    }
    ivl_d3_store(linear, l);
    ivl_d3_store(angular, a);
}

double ivl_sim_plate_overlap(const ivl_sim_model_t *model, const ivl_sim_kin_t *s, int plate)
{
    const ivl_rot_t R = ivl_rot_from_quat(s->q_WB);
    return s->p_WB_m[2] + plate_top(&model->plate[plate], R.row[2]) - model->raw.world_ceiling_height_m;
}
