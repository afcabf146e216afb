#include "ivl_vision.h"

#include <string.h>

#include "ivl_vision_fit.h"
#include "ivl_vision_fixed.h"
#include "ivl_vision_image.h"

enum
{
    PASSES_COARSEST = 5,
    PASSES_COARSE = 3,
    PASSES_STARTED = 3,  ///< of the finest level, where nothing was predicted
    PASSES_PREDICTED = 2,
    DT_US_MIN = 2000,
    DT_US_MAX = 300000,
    QUALITY_BITS = 6  ///< contrast over residual in quarters is one step of the quality
};

/// The normal is at most 60 degrees off the optical axis.
static const int32_t NORMAL_Z_MIN_Q30 = 1 << 29;
/// Quaternion and normal have the length 1 within so much.
static const int64_t UNIT_TOLERANCE_Q30 = (int64_t)1 << 24;
/// Contrast over residual that noise alone has on a white wall is 0.7; lines have as little along them.
static const int64_t CONTRAST_MIN_Q8 = 410;
/// Root of the mean square of the residual that is too much, grey values of 1/16.
static const int64_t RESIDUAL_MAX = 16 * 24;
/// The motion that a pair may have, of the distance.
static const int32_t MOTION_MAX_Q30 = 1 << 28;
/// A last step larger than this has not come to rest.
static const int32_t STEP_MAX_Q30 = 1 << 24;
/// The blocks' scatter is less than the error, since the solution has been fitted to them: factor of the variance, Q8.
static const int64_t SCATTER_FACTOR_Q8 = 300;
/// Part of a cue that is uncertain whatever the picture shows, Q16: calibration, interpolation.
static const int64_t SIGMA_NORM_Q16 = 197;
/// By how much an error of the normal turns flow into closing, and closing into flow, Q16: the normal itself, and the fit that bends a
/// straight flow into a widening one over the wider side of the window.
static const int64_t TURN_Q16 = 105000;
/// A reading is worth nothing if its standard deviation is above this part of RREV, and above 0.25 1/s.
static const int64_t SIGMA_SHARE_MAX_Q16 = 16384;
static const int64_t SIGMA_FLOOR_Q16 = 16384;

static bool within(int64_t value, int64_t lo, int64_t hi)
{
    return value >= lo && value <= hi;
}

static bool cfg_is_possible(const ivl_vision_cfg_t *cfg)
{
    return (cfg->bin == 2 || cfg->bin == 4) && within(cfg->window_w, 32, IVL_VISION_WINDOW_W) && cfg->window_w % IVL_VISION_COLUMNS == 0 &&
           within(cfg->window_h, 24, IVL_VISION_WINDOW_H) && cfg->window_h % IVL_VISION_BANDS == 0 && within(cfg->horizon_q12, 40, 1024) &&
           cfg->attitude_q16 <= 6554 && within(cfg->focal_q16, 16 * 65536, 128 * 65536) &&
           within(cfg->centre_x_q16, 20 * 65536, 60 * 65536) && within(cfg->centre_y_q16, 15 * 65536, 45 * 65536) &&
           within(cfg->radial_q16[0], -65536, 65536) && within(cfg->radial_q16[1], -65536, 65536);
}

bool ivl_vision_init(const ivl_vision_cfg_t *cfg, ivl_vision_state_t *state)
{
    memset(state, 0, sizeof *state);
    return cfg_is_possible(cfg);
}

static int64_t dot_q30(const int32_t a[3], const int32_t b[3])
{
    return ivl_vision_shift((int64_t)a[0] * b[0] + (int64_t)a[1] * b[1] + (int64_t)a[2] * b[2], 30);
}

static bool is_unit(int64_t square_q30)
{
    return within(square_q30, IVL_VISION_ONE_Q30 - UNIT_TOLERANCE_Q30, IVL_VISION_ONE_Q30 + UNIT_TOLERANCE_Q30);
}

static bool in_range(const int32_t *a, int n)
{
    bool good = true;
    for (int i = 0; i < n; i++)
    {
        good = good && within(a[i], -IVL_VISION_ONE_Q30, IVL_VISION_ONE_Q30);
    }
    return good;
}

static bool frame_is_possible(const ivl_vision_frame_t *frame)
{
    if (!frame->pixels || !in_range(frame->turn_q30, 4) || !in_range(frame->normal_q30, 3) || !within(frame->exposure_us, 1, 100000))
    {
        return false;
    }
    const int32_t *q = frame->turn_q30;
    return is_unit(dot_q30(q, q) + ivl_vision_mul_q30(q[3], q[3])) && is_unit(dot_q30(frame->normal_q30, frame->normal_q30)) &&
           frame->normal_q30[2] >= NORMAL_Z_MIN_Q30;
}

/// Rows of the rotation of a quaternion x y z w.
static void rotation(const int32_t q[4], int32_t r_q30[9])
{
    for (int i = 0; i < 3; i++)
    {
        const int     j = (i + 1) % 3, k = (i + 2) % 3;
        const int32_t jj = ivl_vision_mul_q30(q[j], q[j]), kk = ivl_vision_mul_q30(q[k], q[k]);
        const int32_t ij = ivl_vision_mul_q30(q[i], q[j]), kw = ivl_vision_mul_q30(q[k], q[3]);
        const int32_t ik = ivl_vision_mul_q30(q[i], q[k]), jw = ivl_vision_mul_q30(q[j], q[3]);
        r_q30[3 * i + i] = (int32_t)ivl_vision_clamp(IVL_VISION_ONE_Q30 - 2 * ((int64_t)jj + kk), IVL_VISION_ONE_Q30);
        r_q30[3 * i + j] = (int32_t)ivl_vision_clamp(2 * ((int64_t)ij - kw), IVL_VISION_ONE_Q30);
        r_q30[3 * i + k] = (int32_t)ivl_vision_clamp(2 * ((int64_t)ik + jw), IVL_VISION_ONE_Q30);
    }
}

static void multiply(const int32_t a[9], const int32_t b[9], int32_t ab[9])
{
    for (int i = 0; i < 9; i++)
    {
        const int32_t *row = a + i / 3 * 3;
        const int32_t  column[3] = {b[i % 3], b[3 + i % 3], b[6 + i % 3]};
        ab[i] = (int32_t)ivl_vision_clamp(dot_q30(row, column), IVL_VISION_ONE_Q30);
    }
}

/// Turns the kept motions and rotations from the axes of the last camera into those of the new one.
static void turn_memory(ivl_vision_state_t *state, const int32_t turn_q30[4])
{
    int32_t r[9];
    rotation(turn_q30, r);
    for (int i = 0; i < IVL_VISION_SLOTS; i++)
    {
        int32_t turned[9];
        multiply(state->slot[i].turn_q30, r, turned);
        memcpy(state->slot[i].turn_q30, turned, sizeof turned);
    }
    int32_t motion[3];
    for (int k = 0; k < 3; k++)
    {
        const int32_t column[3] = {r[k], r[3 + k], r[6 + k]};
        motion[k] = (int32_t)dot_q30(column, state->motion_q20_per_s);
    }
    memcpy(state->motion_q20_per_s, motion, sizeof motion);
}

static void forget(ivl_vision_state_t *state)
{
    for (int i = 0; i < IVL_VISION_SLOTS; i++)
    {
        state->slot[i].filled = false;
    }
    state->predicts = false;
}

/// Puts the picture into the place of the oldest.
static void keep(const ivl_vision_cfg_t *cfg, ivl_vision_state_t *state, const ivl_vision_frame_t *frame)
{
    static const int32_t UNTURNED[9] = {1 << 30, 0, 0, 0, 1 << 30, 0, 0, 0, 1 << 30};
    state->newest = (state->newest + 1) % IVL_VISION_SLOTS;
    ivl_vision_slot_t *slot = &state->slot[state->newest];
    ivl_vision_image_take(cfg, frame->pixels, state->scratch, slot->pixel);
    slot->t_us = frame->t_us;
    slot->exposure_us = frame->exposure_us;
    slot->filled = true;
    memcpy(slot->turn_q30, UNTURNED, sizeof UNTURNED);
}

static const ivl_vision_slot_t *earlier(const ivl_vision_state_t *state, uint32_t frames)
{
    return &state->slot[(state->newest + IVL_VISION_SLOTS - frames) % IVL_VISION_SLOTS];
}

/// Motion over the present distance that a pair of this length would show, if the velocity stays as it was.
static void predict(const ivl_vision_state_t *state, const int32_t normal_q30[3], uint32_t now_us, uint32_t gap_us, int32_t p_q30[3])
{
    const int64_t closing_q20 = dot_q30(normal_q30, state->motion_q20_per_s);
    // the distance has shrunk since then, at most to a half
    const int64_t past_q20 = closing_q20 * (int32_t)(now_us - state->motion_t_us) / 1000000;
    const int64_t left_q20 = (1 << 20) - ivl_vision_clamp(past_q20, 1 << 19);
    for (int k = 0; k < 3; k++)
    {
        const int64_t p_q20 = ivl_vision_clamp((int64_t)state->motion_q20_per_s[k] * gap_us / 1000000, 1 << 22);
        p_q30[k] = (int32_t)ivl_vision_clamp(p_q20 * ((int64_t)1 << 30) / left_q20, IVL_VISION_ONE_Q30 / 4);
    }
}

/// The longest pair whose closing stays within the horizon and whose shift within twice that; 1 if nothing is known.
static uint32_t choose_frames(const ivl_vision_cfg_t *cfg, const ivl_vision_state_t *state, const ivl_vision_frame_t *frame)
{
    uint32_t      frames = 1;
    const int64_t horizon_q30 = (int64_t)cfg->horizon_q12 << 18;
    for (uint32_t i = 2; state->predicts && i < IVL_VISION_SLOTS; i++)
    {
        int32_t                  p[3];
        const ivl_vision_slot_t *then = earlier(state, i);
        predict(state, frame->normal_q30, frame->t_us, frame->t_us - then->t_us, p);
        const bool near = within(dot_q30(frame->normal_q30, p), -horizon_q30, horizon_q30) &&
                          within(p[0], -2 * horizon_q30, 2 * horizon_q30) && within(p[1], -2 * horizon_q30, 2 * horizon_q30);
        frames = (then->filled && near && frames == i - 1) ? i : frames;
    }
    return frames;
}

static ivl_vision_pair_t finest(const ivl_vision_cfg_t *cfg, const ivl_vision_slot_t *now, const ivl_vision_slot_t *then)
{
    return (ivl_vision_pair_t){.now = now->pixel,
                               .then = then->pixel,
                               .width = IVL_VISION_WIDTH,
                               .height = IVL_VISION_HEIGHT,
                               .focal_q16 = cfg->focal_q16,
                               .centre_x_q16 = cfg->centre_x_q16,
                               .centre_y_q16 = cfg->centre_y_q16,
                               .window_w = cfg->window_w,
                               .window_h = cfg->window_h};
}

/// The same pair at half the resolution; the pixels are made in `memory`.
static ivl_vision_pair_t halved(const ivl_vision_pair_t *fine, int window_w, int window_h, int16_t *memory)
{
    ivl_vision_pair_t coarse = {.width = fine->width / 2,
                                .height = fine->height / 2,
                                .focal_q16 = fine->focal_q16 / 2,
                                .centre_x_q16 = fine->centre_x_q16 / 2 - 16384,
                                .centre_y_q16 = fine->centre_y_q16 / 2 - 16384,
                                .window_w = window_w,
                                .window_h = window_h};
    int16_t          *then = memory + coarse.width * coarse.height;
    ivl_vision_image_halve(fine->now, fine->width, fine->height, memory);
    ivl_vision_image_halve(fine->then, fine->width, fine->height, then);
    coarse.now = memory;
    coarse.then = then;
    return coarse;
}

static bool fit_level(const ivl_vision_pair_t *pair, int passes, uint32_t exposure_now_us, uint32_t exposure_then_us,
                      ivl_vision_belief_t *belief, ivl_vision_block_t block[IVL_VISION_BANDS][IVL_VISION_COLUMNS], ivl_vision_fit_t *fit)
{
    ivl_vision_fit_start(belief, exposure_now_us, exposure_then_us);
    for (int i = 0; i < passes; i++)
    {
        if (!ivl_vision_fit_pass(pair, belief, (i == passes - 1) ? block : NULL, fit))
        {
            return false;
        }
    }
    return true;
}

/// From nothing, two ways: from the coarsest pictures, which see far but not fine patterns, and from half the resolution with no motion.
/// The one that leaves less is taken; of a pattern that repeats both may fit, and the smaller motion is the likelier.
static bool start(const ivl_vision_pair_t *pair, const ivl_vision_slot_t *now, const ivl_vision_slot_t *then, int16_t *scratch,
                  ivl_vision_belief_t *belief)
{
    const ivl_vision_pair_t half = halved(pair, 32, 24, scratch);
    const ivl_vision_pair_t quarter = halved(&half, 16, 12, scratch + 2 * half.width * half.height);
    ivl_vision_belief_t     still = *belief;
    ivl_vision_fit_t        fit, fit_still;
    memset(belief->p_q30, 0, sizeof belief->p_q30);
    memset(still.p_q30, 0, sizeof still.p_q30);
    const bool far = fit_level(&quarter, PASSES_COARSEST, now->exposure_us, then->exposure_us, belief, NULL, &fit) &&
                     fit_level(&half, PASSES_COARSE, now->exposure_us, then->exposure_us, belief, NULL, &fit);
    const bool near = fit_level(&half, PASSES_COARSE, now->exposure_us, then->exposure_us, &still, NULL, &fit_still);
    if (near && (!far || fit_still.residual / 5 * 4 * fit.n_pixels < fit.residual * fit_still.n_pixels))
    {
        *belief = still;
    }
    return far || near;
}

static int64_t quadratic_q60(const ivl_vision_fit_t *fit, const int32_t e_q30[3])
{
    int64_t sum = 0;
    for (int k = 0; k < 9; k++)
    {
        const int64_t ee_q30 = ivl_vision_shift((int64_t)e_q30[k / 3] * e_q30[k % 3], 30);
        // a larger variance is of no use, and its product would not fit
        const int64_t variance_q44 = ivl_vision_clamp(fit->variance_q60[k / 3][k % 3] >> 16, (int64_t)1 << 40);
        sum += ivl_vision_shift(variance_q44 * (ee_q30 >> 8), 6);
    }
    return (sum > 0) ? sum : 0;
}

/// Standard deviation of a cue, Q16: from the scatter along e, the part that is always uncertain, and the other cue times the uncertain normal.
static int32_t sigma_q16(const ivl_vision_cfg_t *cfg, const ivl_vision_fit_t *fit, const int32_t e_q30[3], uint32_t gap_us,
                         int64_t size_q16, int64_t other_q16)
{
    const int64_t scattered_q60 = ivl_vision_clamp(quadratic_q60(fit, e_q30), (int64_t)1 << 54) / 256 * SCATTER_FACTOR_Q8;
    const int64_t part_q22[3] = {(int64_t)(ivl_vision_sqrt((uint64_t)scattered_q60) >> 8) * 1000000 / gap_us,
                                 (size_q16 * SIGMA_NORM_Q16) >> 10, (other_q16 * ((cfg->attitude_q16 * TURN_Q16) >> 16)) >> 10};
    int64_t       square = 0;
    for (int i = 0; i < 3; i++)
    {
        const int64_t held = ivl_vision_clamp(part_q22[i], (int64_t)1 << 30);
        square += held * held;
    }
    return (int32_t)(ivl_vision_sqrt((uint64_t)square) >> 6) + 1;  // nothing is known exactly
}

/// Directions along the surface: forward, which is the camera's x turned into it, and left of that.
static void tangents(const int32_t n[3], int32_t forward_q30[3], int32_t left_q30[3])
{
    const int64_t length = ivl_vision_sqrt(((uint64_t)1 << 60) - (uint64_t)((int64_t)n[0] * n[0]));  // Q30
    for (int k = 0; k < 3; k++)
    {
        const int64_t along = ((k == 0) ? (int64_t)IVL_VISION_ONE_Q30 : 0) - ivl_vision_mul_q30(n[0], n[k]);
        forward_q30[k] = (int32_t)ivl_vision_clamp(along * IVL_VISION_ONE_Q30 / ((length > 0) ? length : 1), IVL_VISION_ONE_Q30);
    }
    for (int k = 0; k < 3; k++)
    {
        const int a = (k + 1) % 3, b = (k + 2) % 3;
        left_q30[k] = (int32_t)ivl_vision_clamp(
            (int64_t)ivl_vision_mul_q30(n[a], forward_q30[b]) - ivl_vision_mul_q30(n[b], forward_q30[a]), IVL_VISION_ONE_Q30);
    }
}

/// A motion over the present distance as a rate over the distance in the middle of the pair, Q16.
static int32_t rate_q16(int64_t p_q30, int64_t closing_q30, uint32_t gap_us)
{
    const int64_t middle_q30 = IVL_VISION_ONE_Q30 + closing_q30 / 2;
    return (int32_t)ivl_vision_clamp(p_q30 * ((int64_t)1 << 26) / middle_q30 * 1000000 / gap_us >> 10, INT32_MAX);
}

static int64_t magnitude(int64_t a)
{
    return (a < 0) ? -a : a;
}

static int64_t larger(int64_t a, int64_t b)
{
    return (a > b) ? a : b;
}

/// Fills the cues; they are taken back if they turn out not to be valid.
static void tell(const ivl_vision_cfg_t *cfg, const ivl_vision_belief_t *belief, const ivl_vision_fit_t *fit,
                 const ivl_vision_frame_t *frame, ivl_vision_out_t *out)
{
    int32_t forward[3], left[3];
    tangents(frame->normal_q30, forward, left);
    const int64_t closing = dot_q30(frame->normal_q30, belief->p_q30);
    out->t_us = frame->t_us - out->gap_us / 2;
    out->rrev_q16_per_s = rate_q16(closing, closing, out->gap_us);
    out->of_y_q16_radps = -rate_q16(dot_q30(forward, belief->p_q30), closing, out->gap_us);
    out->of_x_q16_radps = rate_q16(dot_q30(left, belief->p_q30), closing, out->gap_us);
    const int64_t rrev = magnitude(out->rrev_q16_per_s), flow = larger(magnitude(out->of_x_q16_radps), magnitude(out->of_y_q16_radps));
    out->sigma_rrev_q16_per_s = sigma_q16(cfg, fit, frame->normal_q30, out->gap_us, rrev, flow);
    const int32_t sigma_y = sigma_q16(cfg, fit, forward, out->gap_us, flow, larger(rrev, flow));
    const int32_t sigma_x = sigma_q16(cfg, fit, left, out->gap_us, flow, larger(rrev, flow));
    out->sigma_of_q16_radps = (sigma_x > sigma_y) ? sigma_x : sigma_y;
    const int64_t quality = fit->contrast_q8 >> QUALITY_BITS;
    out->quality = (uint8_t)((quality > 255) ? 255 : quality);
}

static ivl_vision_status_t judge(const ivl_vision_belief_t *belief, const ivl_vision_fit_t *fit, const ivl_vision_out_t *out)
{
    if (fit->contrast_q8 < CONTRAST_MIN_Q8)
    {
        return IVL_VISION_TEXTURE;
    }
    if (fit->residual > RESIDUAL_MAX * RESIDUAL_MAX * fit->n_pixels)
    {
        return IVL_VISION_RESIDUAL;
    }
    for (int k = 0; k < 3; k++)
    {
        if (magnitude(belief->p_q30[k]) > MOTION_MAX_Q30 || magnitude(fit->step_q30[k]) > STEP_MAX_Q30)
        {
            return IVL_VISION_RANGE;
        }
    }
    const int64_t share = (magnitude(out->rrev_q16_per_s) * SIGMA_SHARE_MAX_Q16) >> 16;
    return (out->sigma_rrev_q16_per_s > ((share > SIGMA_FLOOR_Q16) ? share : SIGMA_FLOOR_Q16)) ? IVL_VISION_UNCERTAIN : IVL_VISION_VALID;
}

/// What the next picture is predicted from.
static void remember(ivl_vision_state_t *state, const ivl_vision_belief_t *belief, const int32_t normal_q30[3], const ivl_vision_out_t *out)
{
    const int64_t closing = dot_q30(normal_q30, belief->p_q30);
    for (int k = 0; k < 3; k++)
    {
        state->motion_q20_per_s[k] =
            (int32_t)ivl_vision_clamp((int64_t)rate_q16(belief->p_q30[k], closing, out->gap_us) * 16, IVL_VISION_ONE_Q30);
    }
    state->motion_t_us = out->t_us;
}

static ivl_vision_status_t look(const ivl_vision_cfg_t *cfg, ivl_vision_state_t *state, const ivl_vision_frame_t *frame,
                                ivl_vision_out_t *out)
{
    const uint32_t           frames = choose_frames(cfg, state, frame);
    const ivl_vision_slot_t *now = earlier(state, 0), *then = earlier(state, frames);
    if (!then->filled)
    {
        return IVL_VISION_FIRST;
    }
    ivl_vision_belief_t     belief;
    ivl_vision_fit_t        fit;
    const ivl_vision_pair_t pair = finest(cfg, now, then);
    out->gap_us = now->t_us - then->t_us;
    out->frames = (uint8_t)frames;
    out->started = state->predicts ? 0 : 1;
    memcpy(belief.turn_q30, then->turn_q30, sizeof belief.turn_q30);
    memcpy(belief.normal_q30, frame->normal_q30, sizeof belief.normal_q30);
    if (state->predicts)
    {
        predict(state, frame->normal_q30, frame->t_us, out->gap_us, belief.p_q30);
    }
    else if (!start(&pair, now, then, state->scratch, &belief))
    {
        return IVL_VISION_TEXTURE;
    }
    if (!fit_level(&pair, state->predicts ? PASSES_PREDICTED : PASSES_STARTED, now->exposure_us, then->exposure_us, &belief, state->block,
                   &fit))
    {
        return IVL_VISION_TEXTURE;
    }
    tell(cfg, &belief, &fit, frame, out);
    remember(state, &belief, frame->normal_q30, out);
    return judge(&belief, &fit, out);
}

void ivl_vision_step(const ivl_vision_cfg_t *cfg, ivl_vision_state_t *state, const ivl_vision_frame_t *frame, ivl_vision_out_t *out)
{
    *out = (ivl_vision_out_t){.t_us = frame->t_us, .status = IVL_VISION_INPUT};
    if (!frame_is_possible(frame))
    {
        forget(state);
        return;
    }
    const ivl_vision_slot_t *last = &state->slot[state->newest];
    if (last->filled && !within(frame->t_us - last->t_us, DT_US_MIN, DT_US_MAX))
    {
        forget(state);
    }
    turn_memory(state, frame->turn_q30);
    keep(cfg, state, frame);
    const ivl_vision_status_t status = look(cfg, state, frame, out);
    state->predicts = status == IVL_VISION_VALID;
    if (status != IVL_VISION_VALID)
    {
        *out = (ivl_vision_out_t){
            .t_us = frame->t_us, .gap_us = out->gap_us, .quality = out->quality, .frames = out->frames, .started = out->started};
    }
    out->status = (uint8_t)status;
}
