#include "phys_rotor.h"

#include "phys_math.h"

/// A step of no length asks for the thrust of the instant: that of so short a one.
static const double DT_LEAST_S = 1.0e-9;

/// Nearer to its command than this a rotor has reached it, rad/s.
static const double SPEED_TOLERANCE_RADPS = 1.0e-9;

void ivl_sim_rotor_init(const ivl_sim_model_t *model, ivl_sim_rotors_t *rotors, int lane)
{
    const double speed = model->rotor_speed_hover_radps, hover[IVL_SIM_MOTORS] = {speed, speed, speed, speed};
    ivl_sim_rotor_set(rotors, lane, hover);
    for (int i = 0; i < IVL_SIM_MOTORS; i++)
    {
        rotors->scatter[i][lane] = 1.0;
    }
    rotors->open_circuit_V[lane] = model->raw.battery_voltage_V;
}

void ivl_sim_rotor_set(ivl_sim_rotors_t *rotors, int lane, const double radps[IVL_SIM_MOTORS])
{
    for (int i = 0; i < IVL_SIM_MOTORS; i++)
    {
        rotors->speed_radps[i][lane] = radps[i];
        rotors->command_radps[i][lane] = radps[i];
    }
}

/// Voltages under the present load, 0 for an empty battery.
IVL_SIM_INLINE ivl_wide_t voltages(const ivl_sim_model_t *model, const ivl_sim_rotors_t *rotors)
{
    ivl_wide_t square = ivl_wide(0.0);
    for (int i = 0; i < IVL_SIM_MOTORS; i++)
    {
        square += rotors->speed_radps[i] * rotors->speed_radps[i];
    }
    const ivl_wide_t voltage = rotors->open_circuit_V - model->raw.battery_sag_VpN * model->raw.rotor_thrust_constant_Ns2 * square;
    return ivl_wide_larger(voltage, ivl_wide(0.0));
}

double ivl_sim_rotor_voltage(const ivl_sim_model_t *model, const ivl_sim_rotors_t *rotors, int lane)
{
    return voltages(model, rotors)[lane];
}

/// Speed of a rotor at its present voltage / its speed at the rated voltage, at equal duty cycle.    [MODEL eq. 2.7]
IVL_SIM_INLINE ivl_wide_t speed_scale(const ivl_sim_model_t *model, const ivl_sim_rotors_t *rotors)
{
    const ivl_sim_params_t *raw = &model->raw;
    const ivl_wide_t        excess = voltages(model, rotors) / raw->battery_rated_voltage_V - 1.0;
    return ivl_wide_larger(1.0 + raw->battery_speed_slope_norm * excess, ivl_wide(0.0));
}

void ivl_sim_rotor_command(const ivl_sim_model_t *model, ivl_sim_rotors_t *rotors, const ivl_mask_t *which, const ivl_wide_t thrust_N[4])
{
    const ivl_sim_params_t *raw = &model->raw;
    const ivl_wide_t        none = ivl_wide(0.0), most = ivl_wide(raw->rotor_thrust_max_N);
    const ivl_mask_t        sags = rotors->open_circuit_V > 0.0;
    const bool              any_sags = ivl_mask_any(*which & sags);
    const ivl_wide_t        scale = any_sags ? speed_scale(model, rotors) : ivl_wide(1.0);
    const ivl_wide_t        full = scale * model->rotor_speed_max_radps;
    for (int i = 0; i < IVL_SIM_MOTORS; i++)
    {
        const ivl_wide_t asked = raw->rotor_thrust_gain_norm * thrust_N[i];
        const ivl_wide_t thrust = ivl_wide_select(asked > none, ivl_wide_smaller(asked, most), none);
        ivl_wide_t       speed = ivl_wide_sqrt(thrust / raw->rotor_thrust_constant_Ns2);
        if (any_sags)
        {
            // the autopilot's map from thrust to duty cycle holds at the rated voltage; with compensation at any, up to full duty
            const ivl_wide_t open_loop = scale * speed;
            const ivl_wide_t delivered = open_loop + raw->battery_compensated_norm * (speed - open_loop);
            speed = ivl_wide_select(sags, ivl_wide_smaller(delivered, full), speed);
        }
        rotors->command_radps[i] = ivl_wide_select(*which, speed, rotors->command_radps[i]);
    }
}

ivl_mask_t ivl_sim_rotor_turn(const ivl_sim_rotors_t *rotors)
{
    ivl_wide_t most = ivl_wide(0.0);
    for (int i = 0; i < IVL_SIM_MOTORS; i++)
    {
        most += rotors->speed_radps[i] + rotors->command_radps[i];
    }
    return most > 0.0;
}

/// How a rotor's excess over its command fades within a step: exp(-dt / tau) and tau / dt, where it speeds up and where it slows down.
typedef struct
{
    ivl_wide_t dt_s, decay_up, decay_down, share_up, share_down;
} fade_t;

IVL_SIM_INLINE fade_t fade(const ivl_sim_params_t *raw, ivl_wide_t dt_s)
{
    const ivl_wide_t dt = ivl_wide_select(dt_s > 0.0, dt_s, ivl_wide(DT_LEAST_S));
    return (fade_t){dt, ivl_wide_exp(-dt / raw->rotor_tau_up_s), ivl_wide_exp(-dt / raw->rotor_tau_down_s), raw->rotor_tau_up_s / dt,
                    raw->rotor_tau_down_s / dt};
}

/// Slowing down towards `command` with a share of drag that grows with the square of the speed: a Bernoulli equation for the
/// excess g over the command.  Its mean square over the step by Simpson's rule: the decay is slow against a step.
///                                                                                                    [MODEL eq. 2.9]
IVL_SIM_INLINE ivl_wide_t slow_down(const ivl_sim_model_t *model, ivl_wide_t dt_s, ivl_wide_t g0, ivl_wide_t command, ivl_wide_t *speed)
{
    const double     share = model->raw.rotor_drag_share_norm, tau = model->raw.rotor_tau_down_s, full = model->rotor_speed_max_radps;
    const double     beta = share / (tau * full);
    const ivl_wide_t alpha = (1.0 - share + 2.0 * share * command / full) / tau;
    const ivl_wide_t half = ivl_wide_exp(-0.5 * alpha * dt_s), whole = half * half;
    const ivl_wide_t g1 = g0 * half / (1.0 + beta / alpha * g0 * (1.0 - half));
    const ivl_wide_t g2 = g0 * whole / (1.0 + beta / alpha * g0 * (1.0 - whole));
    *speed = command + g2;
    const ivl_wide_t mean = (g0 + 4.0 * g1 + g2) / 6.0, mean_square = (g0 * g0 + 4.0 * g1 * g1 + g2 * g2) / 6.0;
    return command * command + 2.0 * command * mean + mean_square;
}

/// Advances one rotor; returns the mean of (speed^2) over the step.
IVL_SIM_INLINE ivl_wide_t spin(const ivl_sim_model_t *model, const fade_t *f, ivl_wide_t speed, ivl_wide_t command, ivl_wide_t *next)
{
    const ivl_wide_t gap = speed - command;
    const ivl_mask_t arrived = ivl_wide_abs(gap) < SPEED_TOLERANCE_RADPS, slows = gap > 0.0;
    const ivl_wide_t decay = ivl_wide_select(gap < 0.0, f->decay_up, f->decay_down);
    const ivl_wide_t share = ivl_wide_select(gap < 0.0, f->share_up, f->share_down);
    ivl_wide_t square = command * command + 2.0 * command * gap * share * (1.0 - decay) + 0.5 * gap * gap * share * (1.0 - decay * decay);
    ivl_wide_t after = command + gap * decay;
    if (model->raw.rotor_drag_share_norm > 0.0 && ivl_mask_any(slows))
    {
        ivl_wide_t       slowed;
        const ivl_wide_t slowed_square = slow_down(model, f->dt_s, gap, command, &slowed);
        square = ivl_wide_select(slows, slowed_square, square);
        after = ivl_wide_select(slows, slowed, after);
    }
    *next = ivl_wide_select(arrived, command, after);
    return ivl_wide_select(arrived, command * command, square);
}

/// Thrust gain near the surface, for a rotor that faces it.                                           [MODEL eq. 2.5]
IVL_SIM_INLINE ivl_wide_t ceiling_effect(const ivl_sim_model_t *model, ivl_wide_t gap_m, const ivl_wrot_t *R)
{
    const ivl_sim_params_t *raw = &model->raw;
    const ivl_d3_t          n = model->surface.normal_W;
    const ivl_wide_t        facing = n.x * R->row[0].z + n.y * R->row[1].z + n.z * R->row[2].z;
    const ivl_wide_t        gap = gap_m - facing * raw->rotor_z_m;
    const ivl_wide_t        ratio = raw->aero_rotor_radius_m / ivl_wide_larger(gap, ivl_wide(0.5 * raw->aero_rotor_radius_m));
    const ivl_wide_t        upright = ivl_wide_larger(facing, ivl_wide(0.0));
    return 1.0 + raw->aero_ceiling_gain_norm * upright * ratio * ratio;
}

/// Thrust that is left when the rotors climb along their axis; a descent does not raise it.         [MODEL eq. 2.10]
IVL_SIM_INLINE ivl_wide_t inflow(const ivl_sim_model_t *model, const ivl_w3_t *v_W, const ivl_wrot_t *R)
{
    const ivl_wide_t climb = R->row[0].z * v_W->x + R->row[1].z * v_W->y + R->row[2].z * v_W->z;
    const ivl_wide_t left = 1.0 - model->raw.rotor_inflow_loss_spm * ivl_wide_larger(climb, ivl_wide(0.0));
    return ivl_wide_larger(left, ivl_wide(0.0));
}

/// Factor on the thrust of all rotors, by what the air around them does.
IVL_SIM_INLINE ivl_wide_t air_gain(const ivl_sim_model_t *model, const ivl_sim_airflow_t *flow)
{
    ivl_wide_t gain = ivl_wide(1.0);
    if (model->raw.aero_ceiling_gain_norm > 0.0 || model->raw.rotor_inflow_loss_spm > 0.0)
    {
        const ivl_wrot_t R = ivl_wrot_from_quat(flow->q_WB);
        gain = (model->raw.aero_ceiling_gain_norm > 0.0) ? ceiling_effect(model, flow->gap_m, &R) : gain;
        gain *= (model->raw.rotor_inflow_loss_spm > 0.0) ? inflow(model, flow->v_WB_mps, &R) : ivl_wide(1.0);
    }
    return gain;
}

void ivl_sim_rotor_step(const ivl_sim_model_t *model, const ivl_sim_rotors_t *rotors, const ivl_sim_airflow_t *flow, const ivl_wide_t *dt_s,
                        ivl_sim_rotors_t *next, ivl_sim_load_t *load)
{
    const ivl_sim_params_t *raw = &model->raw;
    const fade_t            f = fade(raw, *dt_s);
    const ivl_wide_t        gain = air_gain(model, flow), zero = ivl_wide(0.0);
    ivl_wide_t              total = zero;
    ivl_w3_t                torque = {zero, zero, zero};
    *next = *rotors;
    for (int i = 0; i < IVL_SIM_MOTORS; i++)
    {
        const ivl_wide_t square = spin(model, &f, rotors->speed_radps[i], rotors->command_radps[i], &next->speed_radps[i]);
        const ivl_wide_t thrust = rotors->scatter[i] * raw->rotor_thrust_constant_Ns2 * square;
        total += gain * thrust;
        torque.x += gain * thrust * model->rotor_y_m[i];
        torque.y -= gain * thrust * model->rotor_x_m[i];
        torque.z += model->rotor_spin[i] * raw->aero_yaw_torque_norm * raw->rotor_torque_constant_m * thrust;
    }
    load->thrust_N = total;
    load->torque_B_Nm = torque;
}
