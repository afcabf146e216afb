#include "phys_rotor.h"

void ivl_sim_rotor_init(const ivl_sim_model_t *model, ivl_sim_rotor_t *rotor)
{
    memset(rotor, 0, sizeof *rotor);
    for (int i = 0; i < IVL_SIM_MOTORS; i++)
    {
        rotor->speed_radps[i] = model->rotor_speed_hover_radps;
        rotor->command_radps[i] = model->rotor_speed_hover_radps;
        rotor->scatter[i] = 1.0;
    }
    rotor->open_circuit_V = model->raw.battery_voltage_V;
}

double ivl_sim_rotor_voltage(const ivl_sim_model_t *model, const ivl_sim_rotor_t *rotor)
{
    double square = 0.0;
    for (int i = 0; i < IVL_SIM_MOTORS; i++)
    {
        square += rotor->speed_radps[i] * rotor->speed_radps[i];
    }
    const double voltage = rotor->open_circuit_V - model->raw.battery_sag_VpN * model->raw.rotor_thrust_constant_Ns2 * square;
    return (voltage > 0.0) ? voltage : 0.0;
}

/// Speed of a rotor at its present voltage / its speed at the rated voltage, at equal duty cycle.    [MODEL eq. 2.7]
static double speed_scale(const ivl_sim_model_t *model, const ivl_sim_rotor_t *rotor)
{
    const ivl_sim_params_t *raw = &model->raw;
    const double            excess = ivl_sim_rotor_voltage(model, rotor) / raw->battery_rated_voltage_V - 1.0;
    const double            scale = 1.0 + raw->battery_speed_slope_norm * excess;
    return (scale > 0.0) ? scale : 0.0;
}

void ivl_sim_rotor_command(const ivl_sim_model_t *model, ivl_sim_rotor_t *rotor, const float thrust_N[4])
{
    const ivl_sim_params_t *raw = &model->raw;
    const bool              sags = rotor->open_circuit_V > 0.0;
    const double            scale = sags ? speed_scale(model, rotor) : 1.0;
    const double            full = scale * model->rotor_speed_max_radps;
    for (int i = 0; i < IVL_SIM_MOTORS; i++)
    {
        const double asked = raw->rotor_thrust_gain_norm * (double)thrust_N[i], most = raw->rotor_thrust_max_N;
        const double thrust = (asked > 0.0) ? ((asked < most) ? asked : most) : 0.0;
        const double speed = sqrt(thrust / raw->rotor_thrust_constant_Ns2);
        if (!sags)
        {
            rotor->command_radps[i] = speed;
            continue;
        }
        // the autopilot's map from thrust to duty cycle holds at the rated voltage; with compensation at any, up to full duty
        const double open_loop = scale * speed;
        const double delivered = open_loop + raw->battery_compensated_norm * (speed - open_loop);
        rotor->command_radps[i] = (delivered < full) ? delivered : full;
    }
}

/// Slowing down towards `command` with a share of drag that grows with the square of the speed: a Bernoulli equation for the
/// excess g over the command.  Its mean square over the step by Simpson's rule: the decay is slow against a step.
///                                                                                                    [MODEL eq. 2.9]
static double slow_down(const ivl_sim_model_t *model, double dt_s, double *speed, double command)
{
    const double share = model->raw.rotor_drag_share_norm, tau = model->raw.rotor_tau_down_s, full = model->rotor_speed_max_radps;
    const double alpha = (1.0 - share + 2.0 * share * command / full) / tau, beta = share / (tau * full);
    const double g0 = *speed - command, half = ivl_sim_exp(-0.5 * alpha * dt_s), whole = half * half;
    const double g1 = g0 * half / (1.0 + beta / alpha * g0 * (1.0 - half));
    const double g2 = g0 * whole / (1.0 + beta / alpha * g0 * (1.0 - whole));
    *speed = command + g2;
    const double mean = (g0 + 4.0 * g1 + g2) / 6.0, mean_square = (g0 * g0 + 4.0 * g1 * g1 + g2 * g2) / 6.0;
    return command * command + 2.0 * command * mean + mean_square;
}

/// Advances one rotor; returns the mean of (speed^2) over the step.
static double spin(const ivl_sim_model_t *model, const ivl_sim_rotor_t *rotor, double *speed, double command)
{
    const double gap = *speed - command;
    if (fabs(gap) < 1.0e-9)
    {
        *speed = command;
        return command * command;
    }
    if (gap > 0.0 && model->raw.rotor_drag_share_norm > 0.0)
    {
        return slow_down(model, rotor->dt_s, speed, command);
    }
    const double decay = (gap < 0.0) ? rotor->decay_up : rotor->decay_down;
    const double share = (gap < 0.0) ? rotor->share_up : rotor->share_down;
    *speed = command + gap * decay;
    return command * command + 2.0 * command * gap * share * (1.0 - decay) + 0.5 * gap * gap * share * (1.0 - decay * decay);
}

/// Thrust gain near the surface, for a rotor that faces it.                                           [MODEL eq. 2.5]
static double ceiling_effect(const ivl_sim_model_t *model, double gap_m, const ivl_rot_t *R)
{
    const ivl_sim_params_t *raw = &model->raw;
    const ivl_d3_t          n = model->surface.normal_W;
    const double            facing = n.x * R->row[0].z + n.y * R->row[1].z + n.z * R->row[2].z;
    const double            gap = gap_m - facing * raw->rotor_z_m;
    const double            least = 0.5 * raw->aero_rotor_radius_m;
    const double            ratio = raw->aero_rotor_radius_m / ((gap > least) ? gap : least);
    const double            upright = (facing > 0.0) ? facing : 0.0;
    return 1.0 + raw->aero_ceiling_gain_norm * upright * ratio * ratio;
}

/// Thrust that is left when the rotors climb along their axis; a descent does not raise it.         [MODEL eq. 2.10]
static double inflow(const ivl_sim_model_t *model, const double v_W_mps[3], const ivl_rot_t *R)
{
    const double climb = R->row[0].z * v_W_mps[0] + R->row[1].z * v_W_mps[1] + R->row[2].z * v_W_mps[2];
    const double left = 1.0 - model->raw.rotor_inflow_loss_spm * ((climb > 0.0) ? climb : 0.0);
    return (left > 0.0) ? left : 0.0;
}

/// Factor on the thrust of all rotors, by what the air around them does.
static double air_gain(const ivl_sim_model_t *model, const ivl_sim_airflow_t *body)
{
    double gain = 1.0;
    if (model->raw.aero_ceiling_gain_norm > 0.0 || model->raw.rotor_inflow_loss_spm > 0.0)
    {
        const ivl_rot_t R = ivl_rot_from_quat(body->q_WB);
        gain = (model->raw.aero_ceiling_gain_norm > 0.0) ? ceiling_effect(model, body->gap_m, &R) : gain;
        gain *= (model->raw.rotor_inflow_loss_spm > 0.0) ? inflow(model, body->v_W_mps, &R) : 1.0;
    }
    return gain;
}

bool ivl_sim_rotor_still(const ivl_sim_rotor_t *rotor)
{
    double most = 0.0;
    for (int i = 0; i < IVL_SIM_MOTORS; i++)
    {
        most += rotor->speed_radps[i] + rotor->command_radps[i];
    }
    return !(most > 0.0);
}

ivl_sim_thrust_t ivl_sim_rotor_step(const ivl_sim_model_t *model, ivl_sim_rotor_t *rotor, const ivl_sim_airflow_t *body, double dt_s)
{
    const ivl_sim_params_t *raw = &model->raw;
    ivl_sim_thrust_t        load = {0.0, {0.0, 0.0, 0.0}};
    if (!(dt_s > 0.0))
    {
        dt_s = 1.0e-9;  // an evaluation without motion: the thrust of this instant
    }
    if (fabs(rotor->dt_s - dt_s) > 0.0)
    {
        rotor->dt_s = dt_s;
        rotor->decay_up = ivl_sim_exp(-dt_s / raw->rotor_tau_up_s);
        rotor->decay_down = ivl_sim_exp(-dt_s / raw->rotor_tau_down_s);
        rotor->share_up = raw->rotor_tau_up_s / dt_s;
        rotor->share_down = raw->rotor_tau_down_s / dt_s;
    }
    const double gain = air_gain(model, body);
    for (int i = 0; i < IVL_SIM_MOTORS; i++)
    {
        const double square = spin(model, rotor, &rotor->speed_radps[i], rotor->command_radps[i]);
        const double thrust = rotor->scatter[i] * raw->rotor_thrust_constant_Ns2 * square;
        load.thrust_N += gain * thrust;
        load.torque_B_Nm[0] += gain * thrust * model->rotor_y_m[i];
        load.torque_B_Nm[1] -= gain * thrust * model->rotor_x_m[i];
        load.torque_B_Nm[2] += model->rotor_spin[i] * raw->aero_yaw_torque_norm * raw->rotor_torque_constant_m * thrust;
    }
    return load;
}
