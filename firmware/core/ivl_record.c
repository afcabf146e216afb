/// @file ivl_record.c
#include "ivl_record.h"

#include <string.h>

#include "ivl_math.h"
#include "ivl_wire.h"

_Static_assert(sizeof(ivl_record_header_t) == 36u, "no padding in the header");
_Static_assert(sizeof(ivl_record_row_t) == 44u, "no padding in a row");
_Static_assert(IVL_RECORD_ROWS_POST < IVL_RECORD_ROWS, "there is room for what was before the trigger");

void ivl_record_init(ivl_recorder_t *recorder)
{
    memset(recorder, 0, sizeof *recorder);
    recorder->header = (ivl_record_header_t){
        .magic = IVL_RECORD_MAGIC,
        .version = (uint8_t)IVL_RECORD_VERSION,
        .row_size = (uint8_t)sizeof(ivl_record_row_t),
        .trigger_row = (uint16_t)IVL_RECORD_NONE,
    };
}

static void start(ivl_recorder_t *recorder, const ivl_cfg_t *cfg)
{
    const uint32_t n_cycle = recorder->header.n_cycle + 1u;
    ivl_record_init(recorder);
    recorder->header.n_cycle = n_cycle;
    recorder->header.tick_hz = cfg->tick_hz;
    recorder->header.thrust_N_max = cfg->motor_thrust_N_max;
}

// rounded to nearest; limited before the conversion, which is undefined outside its range
static int16_t fixed16(float value, int per_unit)
{
    const float scaled = value * (float)per_unit;
    const float rounded = (scaled < 0.0f) ? scaled - 0.5f : scaled + 0.5f;
    return (int16_t)ivl_clamp(rounded, -32767.0f, 32767.0f);
}

static void fixed_vec3(int16_t out[3], ivl_vec3_t v, int per_unit)
{
    out[0] = fixed16(v.x, per_unit);
    out[1] = fixed16(v.y, per_unit);
    out[2] = fixed16(v.z, per_unit);
}

// the table's factors, so that no number stands twice
#define PER_UNIT(type, name, count, per_unit, unit, doc) PER_UNIT_##name = (per_unit),
enum
{
    IVL_RECORD_ROW(PER_UNIT)
};

static void fill(ivl_record_row_t *row, const ivl_cfg_t *cfg, const ivl_state_t *state, const ivl_out_t *out)
{
    const ivl_sample_t *s = &state->sense.sample;
    row->t_us[0] = (uint32_t)state->sense.t_last_us;
    fixed_vec3(row->p, s->p_WB_m, PER_UNIT_p);
    fixed_vec3(row->v, s->v_WB_mps, PER_UNIT_v);
    fixed_vec3(row->w, s->w_B_radps, PER_UNIT_w);
    fixed_vec3(row->f, s->f_B_mps2, PER_UNIT_f);
    row->q[0] = fixed16(s->q_WB.x, PER_UNIT_q);
    row->q[1] = fixed16(s->q_WB.y, PER_UNIT_q);
    row->q[2] = fixed16(s->q_WB.z, PER_UNIT_q);
    row->q[3] = fixed16(s->q_WB.w, PER_UNIT_q);
    row->d[0] = fixed16(out->ceiling.d_ceil_m, PER_UNIT_d);
    for (int i = 0; i < 4; i++)
    {
        row->thrust[i] = (uint8_t)ivl_clamp((float)PER_UNIT_thrust * out->thrust_N[i] / cfg->motor_thrust_N_max + 0.5f, 0.0f, 255.0f);
    }
    row->phase[0] = out->phase_log;
    row->rule[0] = state->guard.rule;
}

static void append(ivl_recorder_t *recorder, const ivl_cfg_t *cfg, const ivl_state_t *state, const ivl_out_t *out)
{
    ivl_record_header_t *header = &recorder->header;
    const bool           is_full = header->n_rows == IVL_RECORD_ROWS;
    fill(&recorder->rows[recorder->next], cfg, state, out);
    recorder->next = (uint16_t)((recorder->next + 1u) % IVL_RECORD_ROWS);
    header->n_rows = is_full ? header->n_rows : (uint16_t)(header->n_rows + 1u);

    if (header->trigger_row != IVL_RECORD_NONE)
    {
        // the oldest row has gone
        header->trigger_row = (uint16_t)(header->trigger_row - (is_full ? 1u : 0u));
        recorder->n_post++;
    }
    else if (state->triggered || (state->phase == IVL_PHASE_LEVEL_OUT))
    {
        header->trigger_row = (uint16_t)(header->n_rows - 1u);
        header->policy_seq = state->policy.id.seq;
        header->policy_crc = state->policy.id.crc;
        header->policy_form = state->policy.id.form;
        header->t_trigger_us = (uint32_t)state->sense.t_last_us;
    }
}

void ivl_record_step(ivl_recorder_t *recorder, const ivl_cfg_t *cfg, const ivl_state_t *state, const ivl_out_t *out)
{
    const bool was_idle = recorder->last_phase == IVL_PHASE_IDLE;
    const bool is_idle = state->phase == IVL_PHASE_IDLE;
    const bool is_next = (recorder->last_phase == IVL_PHASE_READY) && (state->phase == IVL_PHASE_APPROACH);
    recorder->last_phase = state->phase;
    if ((was_idle && !is_idle) || (is_next && (recorder->header.trigger_row != IVL_RECORD_NONE)))
    {
        start(recorder, cfg);
        recorder->last_phase = state->phase;
    }
    if ((recorder->header.frozen == 0u) && !is_idle)
    {
        append(recorder, cfg, state, out);
    }
    const bool is_over = (is_idle && (recorder->header.n_rows > 0u)) || (recorder->n_post >= IVL_RECORD_ROWS_POST);
    recorder->header.frozen = is_over ? 1u : recorder->header.frozen;
}

uint32_t ivl_record_size(void)
{
    return (uint32_t)(sizeof(ivl_record_header_t) + IVL_RECORD_ROWS * sizeof(ivl_record_row_t));
}

// one byte of the reader's view
static uint8_t byte_at(const ivl_recorder_t *recorder, uint32_t address)
{
    const ivl_record_header_t *header = &recorder->header;
    if (address < sizeof *header)
    {
        return ((const uint8_t *)header)[address];
    }
    const uint32_t offset = address - (uint32_t)sizeof *header;
    const uint32_t row_size = (uint32_t)sizeof(ivl_record_row_t);
    if (offset >= header->n_rows * row_size)
    {
        return 0u;
    }
    // a ring that is not full begins at row 0
    const uint32_t oldest = (header->n_rows == IVL_RECORD_ROWS) ? recorder->next : 0u;
    return ((const uint8_t *)recorder->rows)[(oldest * row_size + offset) % (uint32_t)sizeof recorder->rows];
}

bool ivl_record_read(const ivl_recorder_t *recorder, uint32_t address, uint32_t size, uint8_t *bytes)
{
    const bool fits = (address <= ivl_record_size()) && (size <= ivl_record_size() - address);
    const bool readable = (recorder->header.frozen != 0u) || (address + size <= sizeof recorder->header);
    if (!(fits && readable))
    {
        return false;
    }
    for (uint32_t i = 0; i < size; i++)
    {
        bytes[i] = byte_at(recorder, address + i);
    }
    return true;
}
