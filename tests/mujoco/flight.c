/// @file flight.c
/// Flies one landing in MuJoCo: rotors, feet that stick, rows for comparison.  Everything else is MuJoCo's own.
///
/// Shares no code with the simulator that it is compared with.  Compiled and called by engine.py.
#include <math.h>
#include <stdbool.h>
#include <string.h>

#include <mujoco/mujoco.h>

enum
{
    LEGS = 4,
    PLATES = 2,
    GAPS = LEGS + PLATES,  // feet, then plates
    ROW = 26,              // t, qpos[7], qvel[6], foot xyz of four legs
    DOFS = 6,              // of the airframe
};

/// Input: a vehicle in free flight with its legs at rest, and what its motors are told.  SI units.
typedef struct
{
    double        tick_s;
    int           n_ticks;
    int           integrator;      // mjtIntegrator
    int           locate;          // 1: cut a step at the instant of touch; 0: stick at the end of the step
    int           burst;           // 1: sticking impulse in micro-steps; 0: left to the steps that follow
    const double *command_N;       // n_ticks x 4 thrusts
    double        scatter[4];      // factor on each thrust
    double        speed_radps[4];  // rotor speeds at the start
    double        k_thrust_Ns2, tau_up_s, tau_down_s;
    double        ceiling_m, foot_radius_m;
    double        step_flight_s, step_touch_s, step_swing_s;
    double        touch_time_s;  // after a touch, step_touch_s holds for so long
} input_t;

typedef struct
{
    int    n_stuck, order[LEGS];
    int    plate_touched[PLATES];
    int    n_steps;
    int    failed;  // 1: MuJoCo reported a bad state
    double t_plate_s[PLATES], t_stuck_s[LEGS];
    double t_impact_s, theta_impact_rad;
    double v_impact[DOFS];
} output_t;

typedef struct
{
    mjModel       *m;
    mjData        *d;
    const input_t *in;
    output_t      *out;
    int            foot_site[LEGS], plate_geom[PLATES];
    double         speed[4], command[4];
    double         t_s, t_touch_s, theta;
    double         gap[GAPS];
    double         nominal_s;
    mjtNum         saved[256];
} flight_t;

static const double FOOT_TOLERANCE_M = 1.0e-8;
static const double MICRO_S = 1.0e-8;

/// Hunt-Crossley corners with regularised friction, in place of MuJoCo's contact.  userdata: on, height, k, damping, mu, slip speed.
static void corners(const mjModel *m, mjData *d)
{
    if (d->userdata[0] < 0.5)
    {
        return;
    }
    for (int g = 0; g < m->ngeom; g++)
    {
        if (m->geom_type[g] != mjGEOM_BOX)
        {
            continue;
        }
        for (int i = 0; i < 8; i++)
        {
            const mjtNum *s = m->geom_size + 3 * g;
            mjtNum        local[3] = {(i & 1) ? s[0] : -s[0], (i & 2) ? s[1] : -s[1], (i & 4) ? s[2] : -s[2]};
            mjtNum        arm[3], x[3], v[3];
            mju_mulMatVec3(arm, d->geom_xmat + 9 * g, local);
            mju_add3(x, arm, d->geom_xpos + 3 * g);
            const double depth = x[2] - d->userdata[1];
            if (!(depth > 0.0))
            {
                continue;
            }
            mjtNum jacobian[3 * 64];
            mj_jac(m, d, jacobian, NULL, x, m->geom_bodyid[g]);
            mju_mulMatVec(v, jacobian, d->qvel, 3, (int)m->nv);
            const double press = d->userdata[2] * depth * (1.0 + d->userdata[3] * v[2]);
            const double normal = (press > 0.0) ? press : 0.0;
            const double slow = d->userdata[5];
            const double drag = d->userdata[4] * normal / sqrt(v[0] * v[0] + v[1] * v[1] + slow * slow);
            const mjtNum f[3] = {-drag * v[0], -drag * v[1], -normal};
            mjtNum       q[64];
            mju_mulMatTVec(q, jacobian, f, 3, (int)m->nv);
            mju_addTo(d->qfrc_passive, q, (int)m->nv);
        }
    }
}

/// Mean thrust of each motor over h, with first-order lag on the rotor's speed.  `advance`: keep the speeds reached.
static void rotors(flight_t *f, double h, bool advance)
{
    for (int i = 0; i < 4; i++)
    {
        const double c = f->command[i], gap = f->speed[i] - c;
        const double tau = (gap < 0.0) ? f->in->tau_up_s : f->in->tau_down_s;
        const double e1 = -expm1(-h / tau), e2 = -expm1(-2.0 * h / tau);
        const double mean_square = c * c + 2.0 * c * gap * tau / h * e1 + gap * gap * tau / (2.0 * h) * e2;
        f->d->ctrl[i] = f->in->scatter[i] * f->in->k_thrust_Ns2 * mean_square;
        if (advance)
        {
            f->speed[i] = c + gap * (1.0 - e1);
        }
    }
}

static void gaps(const flight_t *f, double gap[GAPS])
{
    const mjData *d = f->d;
    for (int i = 0; i < LEGS; i++)
    {
        gap[i] = d->eq_active[i] ? 1.0 : f->in->ceiling_m - f->in->foot_radius_m - d->site_xpos[3 * f->foot_site[i] + 2];
    }
    for (int i = 0; i < PLATES; i++)
    {
        const mjtNum *R = d->geom_xmat + 9 * f->plate_geom[i], *s = f->m->geom_size + 3 * f->plate_geom[i];
        const double  top = d->geom_xpos[3 * f->plate_geom[i] + 2] + fabs(R[6]) * s[0] + fabs(R[7]) * s[1] + fabs(R[8]) * s[2];
        gap[LEGS + i] = f->out->plate_touched[i] ? 1.0 : f->in->ceiling_m - top;
    }
}

/// Nose-up rotation, unwrapped: the change since the last call is less than half a turn.
static void follow_pitch(flight_t *f)
{
    const mjtNum *R = f->d->xmat + 9;
    const double  angle = atan2(R[6], R[0]);
    f->theta += remainder(angle - f->theta, 2.0 * mjPI);
}

/// Time constants of the equality constraints: stiff, critically damped, stable for steps up to h.
static void set_equality(flight_t *f, double stiffness, double damping)
{
    for (int i = 0; i < LEGS; i++)
    {
        f->m->eq_solref[mjNREF * i] = -stiffness;
        f->m->eq_solref[mjNREF * i + 1] = -damping;
    }
}

static void raw_step(flight_t *f, double h)
{
    f->m->opt.timestep = h;
    mj_step(f->m, f->d);
    mj_kinematics(f->m, f->d);
}

static void advance(flight_t *f, double h)
{
    rotors(f, h, false);
    raw_step(f, h);
}

/// A step of h, cut at the first touch within it.  Returns its length.
static double step(flight_t *f, double h)
{
    double before[GAPS], after[GAPS];
    memcpy(before, f->gap, sizeof before);
    if (f->in->locate)
    {
        mj_getState(f->m, f->d, f->saved, mjSTATE_INTEGRATION);
    }
    advance(f, h);
    gaps(f, after);
    for (int trial = 0; trial < 30 && f->in->locate; trial++)
    {
        double share = 1.0;
        for (int i = 0; i < GAPS; i++)
        {
            if (before[i] > 0.0 && after[i] < -FOOT_TOLERANCE_M)
            {
                // aim just beyond the surface, so that the event is on this side of the cut
                const double s = (before[i] + 0.5 * FOOT_TOLERANCE_M) / (before[i] - after[i]);
                share = (s < share) ? s : share;
            }
        }
        if (!(share < 1.0))
        {
            break;
        }
        h *= share;
        mj_setState(f->m, f->d, f->saved, mjSTATE_INTEGRATION);
        advance(f, h);
        gaps(f, after);
    }
    rotors(f, h, true);
    f->t_s += h;
    f->out->n_steps++;
    memcpy(f->gap, after, sizeof after);
    follow_pitch(f);
    return h;
}

static void note_impact(flight_t *f)
{
    if (f->out->t_impact_s < 0.0)
    {
        f->out->t_impact_s = f->t_s;
        f->out->theta_impact_rad = f->theta;
        memcpy(f->out->v_impact, f->d->qvel, sizeof f->out->v_impact);
    }
}

/// MuJoCo's constraint solver stops the feet within a few steps of no length: an inelastic impulse.
static void impulse(flight_t *f)
{
    const int integrator = f->m->opt.integrator;
    f->m->opt.integrator = mjINT_EULER;
    set_equality(f, 1.0, 1.0 / MICRO_S);
    for (int i = 0; i < 5; i++)
    {
        raw_step(f, MICRO_S);
    }
    f->m->opt.integrator = integrator;
    f->nominal_s = 0.0;  // restore the constraint's time constants
}

/// Feet and plates that arrived during the last step.
static void touches(flight_t *f)
{
    bool stuck = false;
    for (int i = 0; i < PLATES; i++)
    {
        if (!f->out->plate_touched[i] && f->gap[LEGS + i] <= FOOT_TOLERANCE_M)
        {
            note_impact(f);
            f->out->plate_touched[i] = 1;
            f->out->t_plate_s[i] = f->t_s;
            f->t_touch_s = f->t_s;
        }
    }
    for (int i = 0; i < LEGS; i++)
    {
        if (!f->d->eq_active[i] && f->gap[i] <= FOOT_TOLERANCE_M)
        {
            note_impact(f);
            memcpy(f->m->eq_data + mjNEQDATA * i + 3, f->d->site_xpos + 3 * f->foot_site[i], 3 * sizeof(mjtNum));
            f->d->eq_active[i] = 1;
            f->out->order[f->out->n_stuck] = i + 1;
            f->out->t_stuck_s[f->out->n_stuck] = f->t_s;
            f->out->n_stuck++;
            f->t_touch_s = f->t_s;
            stuck = true;
        }
    }
    if (stuck && f->in->burst)
    {
        impulse(f);
    }
    if (stuck)
    {
        gaps(f, f->gap);
    }
}

static double nominal_step(const flight_t *f)
{
    if (f->out->t_impact_s < 0.0)
    {
        return f->in->step_flight_s;
    }
    return (f->t_s < f->t_touch_s + f->in->touch_time_s) ? f->in->step_touch_s : f->in->step_swing_s;
}

static void tick(flight_t *f, double end_s)
{
    while (end_s - f->t_s > 1.0e-12)
    {
        const double left = end_s - f->t_s, nominal = nominal_step(f);
        if (fabs(nominal - f->nominal_s) > 0.0)
        {
            f->nominal_s = nominal;
            set_equality(f, 0.25 / (nominal * nominal), 1.0 / nominal);
        }
        step(f, left / ceil(left / nominal - 1.0e-6));
        touches(f);
    }
    f->t_s = end_s;
}

static void write_row(const flight_t *f, double *row)
{
    row[0] = f->t_s;
    memcpy(row + 1, f->d->qpos, 7 * sizeof(double));
    memcpy(row + 8, f->d->qvel, 6 * sizeof(double));
    for (int i = 0; i < LEGS; i++)
    {
        memcpy(row + 14 + 3 * i, f->d->site_xpos + 3 * f->foot_site[i], 3 * sizeof(double));
    }
}

static void init(flight_t *f, mjModel *m, mjData *d, const input_t *in, output_t *out)
{
    memset(f, 0, sizeof *f);
    memset(out, 0, sizeof *out);
    f->m = m;
    f->d = d;
    f->in = in;
    f->out = out;
    out->t_impact_s = -1.0;
    const char *const feet[LEGS] = {"foot1", "foot2", "foot3", "foot4"}, *const plates[PLATES] = {"prop_plate", "base_plate"};
    for (int i = 0; i < LEGS; i++)
    {
        f->foot_site[i] = mj_name2id(m, mjOBJ_SITE, feet[i]);
        d->eq_active[i] = 0;
        f->speed[i] = in->speed_radps[i];
    }
    for (int i = 0; i < PLATES; i++)
    {
        f->plate_geom[i] = mj_name2id(m, mjOBJ_GEOM, plates[i]);
    }
    m->opt.integrator = in->integrator;
    mj_kinematics(m, d);
    gaps(f, f->gap);
    f->theta = atan2(d->xmat[9 + 6], d->xmat[9]);
}

/// @param[in,out] d  the start: qpos, qvel; the end
/// @param[out] rows  NULL, or (n_ticks + 1) x ROW: after the start and after each tick
/// @return 0; 1 if the state does not fit the workspace
int fly(mjModel *m, mjData *d, const input_t *in, output_t *out, double *rows)
{
    flight_t f;
    if (mj_stateSize(m, mjSTATE_INTEGRATION) > (int)(sizeof f.saved / sizeof f.saved[0]) || m->nv > 64)
    {
        return 1;
    }
    mjcb_passive = corners;
    init(&f, m, d, in, out);
    if (rows)
    {
        write_row(&f, rows);
    }
    for (int n = 0; n < in->n_ticks; n++)
    {
        for (int i = 0; i < 4; i++)
        {
            const double thrust = in->command_N[4 * n + i];
            f.command[i] = sqrt(((thrust > 0.0) ? thrust : 0.0) / in->k_thrust_Ns2);
        }
        tick(&f, (n + 1) * in->tick_s);
        if (rows)
        {
            write_row(&f, rows + (size_t)ROW * (size_t)(n + 1));
        }
    }
    out->failed = d->warning[mjWARN_BADQPOS].number || d->warning[mjWARN_BADQVEL].number || d->warning[mjWARN_BADQACC].number;
    return 0;
}
