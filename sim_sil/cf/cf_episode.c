/// @file cf_episode.c
/// Landings: each begins when the app accepts an approach, and is judged by the same functions as in the process of the host.
#include <string.h>

#include "app_convert.h"
#include "cf_vehicle.h"
#include "ivl_wire.h"

/// The parameter, if it is what the command's float was made from; else the float.
static double exact(double parameter, float from_parameter, float commanded)
{
    return (from_parameter >= commanded && from_parameter <= commanded) ? parameter : (double)commanded;
}

static uint64_t seed_of(const ivl_cf_settings_t *set)
{
    return (uint64_t)set->sim.seed_hi << 32 | set->sim.seed_lo;
}

static uint64_t stream_of(const ivl_cf_settings_t *set)
{
    return (uint64_t)set->sim.stream_hi << 32 | set->sim.stream_lo;
}

static ivl_sim_spec_t spec_of(const ivl_cf_settings_t *set)
{
    const ivl_command_t *cmd = app_command();
    const ivl_policy_t  *policy = &app_core_state()->policy;
    const float          angle_rad = (float)(set->sim.angle_deg * (IVL_SIM_PI / 180.0));
    ivl_sim_spec_t       spec = {
        .speed_mps = {exact(set->sim.speed_mps, (float)set->sim.speed_mps, cmd->speed_mps)},
        .angle_deg = {(angle_rad >= cmd->angle_rad && angle_rad <= cmd->angle_rad) ? set->sim.angle_deg
                                                                                   : (double)cmd->angle_rad * (180.0 / IVL_SIM_PI)},
        .d_ceil_m = {set->sim.d_ceil_m},
        .seed = {seed_of(set)},
        .stream = {stream_of(set)},
        .start = {set->sim.start},
        .form = {policy->id.form},
    };
    for (uint32_t i = 0; i < policy->n; i++)
    {
        spec.theta[i] = (double)policy->theta[i];
    }
    return spec;
}

static void end(ivl_cf_t *cf)
{
    ivl_cf_episode_t *e = &cf->episode;
    e->running = false;
    e->ended = 1;
    e->outcome = e->now;
    const uint32_t crc = ivl_wire_crc(ivl_wire_crc(0, e->draws, sizeof e->draws), &e->outcome, sizeof e->outcome);
    e->header = (ivl_cf_outcome_header_t){IVL_CF_OUTCOME_MAGIC, e->number, (uint32_t)sizeof e->outcome, e->policy_seq, crc};
}

/// @return false if there is no such landing
static bool put_to_start(ivl_cf_t *cf)
{
    const ivl_sim_spec_t spec = spec_of(&cf->set);
    if (!ivl_sim_spec_good(&spec))
    {
        return false;
    }
    cf->grounded = false;
    return ivl_sim_rollout_start(&cf->group, IVL_CF_LANE, &spec);
}

/// Voltage of the battery that drives the rotors, under their load; 0: a supply that never sags.
static float rotor_V(const ivl_cf_t *cf)
{
    const ivl_sim_rotors_t *rotors = &cf->group.rotor;
    return (rotors->open_circuit_V[IVL_CF_LANE] > 0.0) ? (float)ivl_sim_rotor_voltage(&cf->model, rotors, IVL_CF_LANE) : 0.0f;
}

void ivl_cf_episode_begin(ivl_cf_t *cf)
{
    ivl_cf_episode_t *e = &cf->episode;
    e->number++;
    e->running = true;
    e->ended = 0;
    e->policy_seq = app_core_state()->policy.id.seq;
    e->draws[0] = seed_of(&cf->set);
    e->draws[1] = stream_of(&cf->set);
    ivl_sim_outcome_clear(&e->now);
    if (cf->set.sim.start == IVL_CF_START_AS_FLOWN)
    {
        ivl_sim_world_rebase(&cf->group, IVL_CF_LANE);
        cf->zero_us = ivl_cf_time_us(cf);
        e->battery_V = rotor_V(cf);
    }
    else if (put_to_start(cf))
    {
        cf->zero_us = ivl_cf_time_us(cf);
        e->battery_V = rotor_V(cf);
        ivl_sim_world_tick(&cf->group, IVL_CF_LANE);
    }
    else
    {
        e->now.end_reason[0] = IVL_SIM_END_REFUSED;
        e->now.t_end_s[0] = 0.0;
        end(cf);
        return;
    }
    ivl_sim_rollout_note(&cf->group, IVL_CF_LANE, &e->now);
}

void ivl_cf_episode_look(ivl_cf_t *cf)
{
    if (cf->episode.running && ivl_sim_rollout_ended(&cf->group, IVL_CF_LANE, &cf->episode.now))
    {
        end(cf);
    }
}
