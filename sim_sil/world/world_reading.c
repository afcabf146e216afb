#include "world_reading.h"

#include "world_clock.h"

bool ivl_sim_readings_any(const ivl_sim_model_t *model)
{
    bool any = false;
    for (size_t i = 0; i < model->readings->n; i++)
    {
        any = any || model->readings->row[i].sensor(&model->raw).rate_hz > 0.0;
    }
    return any;
}

void ivl_sim_readings_init(const ivl_sim_model_t *model, const ivl_sim_rng_t *rng, ivl_sim_reading_t readings[IVL_SIM_READINGS_MAX])
{
    for (size_t k = 0; k < model->readings->n; k++)
    {
        const ivl_sim_sensor_t sensor = model->readings->row[k].sensor(&model->raw);
        ivl_sim_reading_t     *reading = &readings[k];
        reading->n_taken = 0;
        reading->n_delivered = 0;
        if (sensor.rate_hz > 0.0)
        {
            double n[4];
            ivl_sim_normal4(rng, sensor.draw_noise, UINT32_MAX, n);
            reading->bias = sensor.bias * n[0];
            reading->scale = sensor.mean_norm + sensor.bias_norm * n[1];
            reading->next_s = ivl_sim_uniform(rng, IVL_SIM_DRAW_SENSOR_PHASE, 1u + (uint32_t)k) / sensor.rate_hz;
        }
    }
}

/// Normal numbers of a sample, which take after those of the sample before.                                            [MODEL eq. 13.19]
static void correlate(double correlation, const double n[4], ivl_sim_reading_t *reading)
{
    const bool   first = reading->n_taken == 0 || !(correlation > 0.0);
    const double kept = first ? 0.0 : correlation, fresh = first ? 1.0 : sqrt(1.0 - correlation * correlation);
    for (int i = 0; i < 2; i++)
    {
        reading->noise[i] = first ? n[i] : kept * reading->noise[i] + fresh * n[i];
    }
}

/// The error of a sample that has little to do with the truth; 0 for most.
static double outlier(const ivl_sim_sensor_t *sensor, const ivl_sim_rng_t *rng, double value, uint32_t index)
{
    if (!(sensor->outlier > 0.0) || !(ivl_sim_uniform(rng, sensor->draw_outlier, index) < sensor->outlier))
    {
        return 0.0;
    }
    double n[4];
    ivl_sim_normal4(rng, sensor->draw_outlier, UINT32_MAX - index, n);
    return sensor->outlier_size * n[0] + sensor->outlier_norm * value * n[1];
}

static void take(const ivl_sim_sensor_t *sensor, const ivl_sim_rng_t *rng, double value, ivl_sim_reading_t *reading)
{
    const uint32_t i = reading->n_taken % IVL_SIM_READING_QUEUE;
    double         n[4];
    ivl_sim_normal4(rng, sensor->draw_noise, reading->n_taken, n);
    correlate(sensor->correlation, n, reading);
    const double true_value = value, wild = outlier(sensor, rng, value, reading->n_taken);
    value += reading->bias + sensor->noise * reading->noise[0] + sensor->noise_norm * value * reading->noise[1];
    value += reading->scale * true_value + wild;
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

void ivl_sim_readings_read(const ivl_sim_scene_t *scene, const ivl_sim_rng_t *rng, double t_s,
                           ivl_sim_reading_t readings[IVL_SIM_READINGS_MAX], ivl_in_t *in)
{
    const ivl_sim_model_t *model = scene->model;
    for (size_t k = 0; k < model->readings->n; k++)
    {
        const ivl_sim_reading_row_t *row = &model->readings->row[k];
        const ivl_sim_sensor_t       sensor = row->sensor(&model->raw);
        ivl_sim_reading_t           *reading = &readings[k];
        // a tick brings a few samples; were it more than the queue holds, the rest would wait for the next one
        for (int i = 0; i < IVL_SIM_READING_QUEUE && sensor.rate_hz > 0.0 && reading->next_s <= t_s + IVL_SIM_TIME_SLACK_S; i++)
        {
            take(&sensor, rng, row->truth(scene, t_s - reading->next_s), reading);
        }
        deliver(t_s, reading, row->into(in));
    }
}
