#include "phys_mass.h"

enum
{
    N = IVL_SIM_TWIST
};

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
            to[ivl_sim_packed(i, j)][lane] = m[i][j];
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

/// Lane 0 into all lanes.
static void spread(ivl_wide_t *number, int n)
{
    for (int i = 0; i < n; i++)
    {
        number[i] = ivl_wide(number[i][0]);
    }
}

void ivl_sim_contact_spread(const ivl_sim_model_t *model, ivl_sim_contact_t *contact, const ivl_sim_foot_t foot[IVL_SIM_LEGS])
{
    memset(contact, 0, sizeof *contact);
    ivl_sim_contact_set(model, contact, 0, foot);
    spread(contact->inverse_mass, IVL_SIM_LEGS);
    spread(contact->sliding, IVL_SIM_LEGS);
    spread(contact->mass6, IVL_SIM_PACKED);
    spread(contact->inverse_mass6, IVL_SIM_PACKED);
}

void ivl_sim_mass_while_sliding(const ivl_sim_model_t *model, const ivl_sim_contact_t *contact, const ivl_w3_t *normal_B,
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
                m[i][j] = contact->mass6[ivl_sim_packed(i, j)][lane];
            }
        }
        bool slides = false;
        for (int i = 0; i < IVL_SIM_LEGS; i++)
        {
            const double mu = contact->sliding[i][lane] * leg->mass_cross_kg * leg->mass_cross_kg / leg->mass_foot_kg;
            slides = slides || contact->sliding[i][lane] > 0.0;
            add_mass_along(m, mu, leg->hip_B_m[i], ivl_w3_lane(normal_B, lane));
        }
        if (slides)
        {
            ivl_sim_invert6((const double (*)[N])m, inverse);
            store_packed((const double (*)[N])inverse, inverse6, lane);
        }
    }
}
