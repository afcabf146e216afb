#include "world_reading.h"

#include "world_clock.h"

/// Nearer than this a sensor sees nothing but the ceiling's paint, and 1/d need not be finite.
static const double D_MIN_M = 1.0e-3;

/// One sensor's numbers; `rate_hz` 0: there is none.
typedef struct
{
    double         rate_hz, delay_s, noise, noise_norm, bias, resolution, lo, hi, drop_norm;
    ivl_sim_draw_t draw_noise, draw_drop;
} sensor_t;

static sensor_t sensor_of(const ivl_sim_params_t *raw, int kind)
{
    switch (kind)
    {
    case IVL_SIM_READING_RREV:
        return (sensor_t){
            raw->rrev_rate_hz,          raw->rrev_delay_s,    raw->rrev_noise_per_s, raw->rrev_noise_rel_norm, 0.0,
            raw->rrev_resolution_per_s, -raw->rrev_max_per_s, raw->rrev_max_per_s,   raw->rrev_drop_norm,      IVL_SIM_DRAW_RREV,
            IVL_SIM_DRAW_RREV_DROP};
    case IVL_SIM_READING_RANGE:
        return (sensor_t){raw->range_rate_hz,   raw->range_delay_s,      raw->range_noise_m,     0.0,
                          raw->range_bias_m,    raw->range_resolution_m, raw->range_min_m,       raw->range_max_m,
                          raw->range_drop_norm, IVL_SIM_DRAW_RANGE,      IVL_SIM_DRAW_RANGE_DROP};
    default:
        return (sensor_t){raw->flow_rate_hz,
                          raw->flow_delay_s,
                          raw->flow_noise_radps,
                          0.0,
                          0.0,
                          raw->flow_resolution_radps,
                          -raw->flow_max_radps,
                          raw->flow_max_radps,
                          raw->flow_drop_norm,
                          IVL_SIM_DRAW_FLOW,
                          IVL_SIM_DRAW_FLOW_DROP};
    }
}

void ivl_sim_readings_init(const ivl_sim_model_t *model, const ivl_sim_rng_t *rng, ivl_sim_reading_t readings[IVL_SIM_READINGS])
{
    for (int kind = 0; kind < IVL_SIM_READINGS; kind++)
    {
        const sensor_t     sensor = sensor_of(&model->raw, kind);
        ivl_sim_reading_t *reading = &readings[kind];
        reading->n_taken = 0;
        reading->n_delivered = 0;
        if (sensor.rate_hz > 0.0)
        {
            double n[4];
            ivl_sim_normal4(rng, sensor.draw_noise, UINT32_MAX, n);
            reading->bias = sensor.bias * n[0];
            reading->next_s = ivl_sim_uniform(rng, IVL_SIM_DRAW_SENSOR_PHASE, 1u + (uint32_t)kind) / sensor.rate_hz;
        }
    }
}

/// True value at an instant `age_s` ago; a range is infinite where the ceiling is out of the sensor's sight.
static double truth(const ivl_sim_model_t *model, const ivl_sim_kin_t *state, const double a_W_mps2[3], double age_s, int kind)
{
    const double plane = model->raw.world_ceiling_height_m + model->raw.world_sensed_gap_offset_m;
    const double z = state->p_WB_m[2] - age_s * (state->v_WB_mps[2] - 0.5 * age_s * a_W_mps2[2]);
    const double d = (plane - z > D_MIN_M) ? plane - z : D_MIN_M;
    if (kind == IVL_SIM_READING_RREV)
    {
        return (state->v_WB_mps[2] - age_s * a_W_mps2[2]) / d;
    }
    if (kind == IVL_SIM_READING_FLOW)
    {
        return -(state->v_WB_mps[0] - age_s * a_W_mps2[0]) / d;
    }
    const double *q = state->q_WB;
    const double  up = 1.0 - 2.0 * (q[0] * q[0] + q[1] * q[1]);
    return (up > 0.0) ? d / up : (double)INFINITY;
}

static void take(const sensor_t *sensor, const ivl_sim_rng_t *rng, double value, ivl_sim_reading_t *reading)
{
    const uint32_t i = reading->n_taken % IVL_SIM_READING_QUEUE;
    double         n[4];
    ivl_sim_normal4(rng, sensor->draw_noise, reading->n_taken, n);
    value += reading->bias + sensor->noise * n[0] + sensor->noise_norm * value * n[1];
    if (sensor->resolution > 0.0)
    {
        value = sensor->resolution * floor(value / sensor->resolution + 0.5);
    }
    reading->due_s[i] = reading->next_s + sensor->delay_s;
    reading->value[i] = value;
    reading->valid[i] = value >= sensor->lo && value <= sensor->hi &&
                        !(sensor->drop_norm > 0.0 && ivl_sim_uniform(rng, sensor->draw_drop, reading->n_taken) < sensor->drop_norm);
    reading->n_taken++;
    reading->next_s += 1.0 / sensor->rate_hz;
}

static void deliver(double t_s, ivl_sim_reading_t *reading, ivl_reading_t *in)
{
    while (reading->n_delivered != reading->n_taken)
    {
        const uint32_t i = reading->n_delivered % IVL_SIM_READING_QUEUE;
        if (reading->due_s[i] > t_s + IVL_SIM_TIME_SLACK_S)
        {
            return;
        }
        in->t_us = ivl_sim_clock_us(reading->due_s[i]);
        in->value = reading->valid[i] ? (float)reading->value[i] : 0.0f;
        in->valid = reading->valid[i] ? 1u : 0u;
        reading->n_delivered++;
    }
}

void ivl_sim_readings_read(const ivl_sim_model_t *model, const ivl_sim_rng_t *rng, const ivl_sim_kin_t *state, const double a_W_mps2[3],
                           double t_s, ivl_sim_reading_t readings[IVL_SIM_READINGS], ivl_in_t *in)
{
    ivl_reading_t *const told[IVL_SIM_READINGS] = {&in->rrev, &in->range, &in->flow};
    for (int kind = 0; kind < IVL_SIM_READINGS; kind++)
    {
        const sensor_t     sensor = sensor_of(&model->raw, kind);
        ivl_sim_reading_t *reading = &readings[kind];
        // a tick brings a few samples; were it more than the queue holds, the rest would wait for the next one
        for (int i = 0; i < IVL_SIM_READING_QUEUE && sensor.rate_hz > 0.0 && reading->next_s <= t_s + IVL_SIM_TIME_SLACK_S; i++)
        {
            take(&sensor, rng, truth(model, state, a_W_mps2, t_s - reading->next_s, kind), reading);
        }
        deliver(t_s, reading, told[kind]);
    }
}
