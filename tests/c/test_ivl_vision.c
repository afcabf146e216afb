/// @file test_ivl_vision.c
/// The estimator of cues from pictures: its parts, approaches with known cues, what it must refuse, and the same bits on every processor.
#include "ivl_vision.h"

#include "ivl_vision_fit.h"
#include "ivl_vision_fixed.h"
#include "ivl_vision_image.h"
#include "ivl_vision_solve.h"
#include "ivl_vision_warp.h"
#include "test_ivl_support.h"
#include "vision_fixture.h"

// more of them for a long search
#ifndef N_VISION_FUZZ
#define N_VISION_FUZZ 60
#endif

static ivl_vision_state_t state;
static uint8_t            raw[RAW_W * RAW_H];
static int16_t            pixel[IVL_VISION_PIXELS], scratch[IVL_VISION_PIXELS];

static const int32_t SPEED_UM_PER_S = 2500000, D_UM = 1500000;

/// Picture k of an approach at 60 Hz, straight up and `slope` / 4 of that along x; what the estimator says to it.
static ivl_vision_out_t look_at(surface_t *surface, const ivl_vision_cfg_t *cfg, int k, int32_t slope)
{
    const uint32_t t_us = (uint32_t)k * 16667u;
    const int32_t  way_um = (int32_t)((int64_t)SPEED_UM_PER_S * t_us / 1000000);
    draw(surface, way_um * slope / 4, 0, D_UM - way_um, (uint32_t)k, raw);
    const ivl_vision_frame_t frame = vision_frame(raw, 4000000000u + t_us);  // the clock wraps on the way
    ivl_vision_out_t         out;
    ivl_vision_step(cfg, &state, &frame, &out);
    return out;
}

static void assert_says_nothing(const ivl_vision_out_t *out)
{
    TEST_ASSERT_NOT_EQUAL(IVL_VISION_VALID, out->status);
    TEST_ASSERT_EQUAL_INT32(0, out->rrev_q16_per_s);
    TEST_ASSERT_EQUAL_INT32(0, out->of_x_q16_radps);
    TEST_ASSERT_EQUAL_INT32(0, out->of_y_q16_radps);
    TEST_ASSERT_EQUAL_INT32(0, out->sigma_rrev_q16_per_s);
    TEST_ASSERT_EQUAL_INT32(0, out->sigma_of_q16_radps);
}

// ---- numbers

static void test_a_shift_to_the_right_rounds_down_and_a_rounded_one_to_the_nearest(void)
{
    TEST_ASSERT_EQUAL_INT64(-2, (int64_t)-3 >> 1);
    TEST_ASSERT_EQUAL_INT64(-1, ivl_vision_shift(-3, 1));
    TEST_ASSERT_EQUAL_INT64(2, ivl_vision_shift(3, 1));
    TEST_ASSERT_EQUAL_INT64(40, ivl_vision_scale(5, 3));
    TEST_ASSERT_EQUAL_INT64(-1, ivl_vision_scale(-5, -3));
    TEST_ASSERT_EQUAL_INT64(0, ivl_vision_scale(INT64_MAX, -64));
}

static void test_the_square_root_is_the_largest_whole_number_whose_square_is_not_above(void)
{
    rng_t rng = {3};
    for (int i = 0; i < 2000; i++)
    {
        const uint64_t a = rng_u64(&rng) >> (i % 64);
        const uint64_t root = ivl_vision_sqrt(a);
        TEST_ASSERT_TRUE(root * root <= a);
        TEST_ASSERT_TRUE(root == UINT32_MAX || (root + 1) * (root + 1) > a);
        const int bits = ivl_vision_bits(a);
        TEST_ASSERT_TRUE((bits == 64 || (a >> bits) == 0) && (a == 0 || (a >> (bits - 1)) == 1));
    }
}

// ---- least squares

/// Sums of n random rows whose terms have very different sizes, with a right-hand side that x explains.
static ivl_vision_sums_t sums_of(rng_t *rng, const int32_t x[IVL_VISION_TERMS], int n, bool with_twins)
{
    ivl_vision_sums_t sums = {.residual = 0};
    for (int row = 0; row < n; row++)
    {
        int64_t term[IVL_VISION_TERMS], r = 0;
        for (int i = 0; i < IVL_VISION_TERMS; i++)
        {
            const uint32_t size = 16u << (2 * (i % 4));
            term[i] = (int64_t)rng_below(rng, 2 * size) - size;
        }
        term[7] = with_twins ? term[6] : term[7];
        for (int i = 0; i < IVL_VISION_TERMS; i++)
        {
            r += term[i] * x[i];
        }
        for (int i = 0; i < IVL_VISION_TERMS; i++)
        {
            for (int k = i; k < IVL_VISION_TERMS; k++)
            {
                sums.normal[i][k] += term[i] * term[k];
            }
            sums.right[i] += term[i] * r;
        }
        sums.residual += r * r;
    }
    return sums;
}

static void test_the_motion_that_explains_all_residuals_is_found(void)
{
    rng_t rng = {5};
    for (int i = 0; i < 50; i++)
    {
        int32_t x[IVL_VISION_TERMS] = {0};
        for (int k = IVL_VISION_MOTION; k < IVL_VISION_TERMS; k++)
        {
            x[k] = (int32_t)rng_below(&rng, 200) - 100;
        }
        const ivl_vision_sums_t sums = sums_of(&rng, x, 400, false);
        ivl_vision_solution_t   solution;
        TEST_ASSERT_TRUE(ivl_vision_solve(&sums, &solution));
        for (int k = IVL_VISION_MOTION; k < IVL_VISION_TERMS; k++)
        {
            TEST_ASSERT_DOUBLE_WITHIN(2.0e-2, (double)x[k], (double)solution.x_q30[k] / 1073741824.0);
        }
        int64_t motion_q30[3];
        ivl_vision_contribution(&solution, sums.right, motion_q30);
        for (int k = 0; k < 3; k++)
        {
            TEST_ASSERT_DOUBLE_WITHIN(0.1, (double)x[IVL_VISION_MOTION + k], (double)motion_q30[k] / 1073741824.0);
        }
    }
}

static void test_two_terms_that_are_the_same_are_not_told_apart(void)
{
    rng_t                   rng = {6};
    const int32_t           x[IVL_VISION_TERMS] = {0, 0, 0, 0, 0, 1, 2, 3};
    const ivl_vision_sums_t sums = sums_of(&rng, x, 400, true), nothing = {.residual = 0};
    ivl_vision_solution_t   solution;
    TEST_ASSERT_FALSE(ivl_vision_solve(&sums, &solution));
    TEST_ASSERT_FALSE(ivl_vision_solve(&nothing, &solution));
}

// ---- pictures

static void test_a_flat_field_makes_a_shaded_wall_even(void)
{
    uint16_t         flat[IVL_VISION_FLAT_ROWS * IVL_VISION_FLAT_COLUMNS];
    ivl_vision_cfg_t cfg = vision_cfg();
    for (int i = 0; i < IVL_VISION_FLAT_ROWS * IVL_VISION_FLAT_COLUMNS; i++)
    {
        flat[i] = (uint16_t)(4096 + 100 * (i % IVL_VISION_FLAT_COLUMNS) + 50 * (i / IVL_VISION_FLAT_COLUMNS));
    }
    for (int i = 0; i < RAW_W * RAW_H; i++)
    {
        const int x = i % RAW_W / 2, y = i / RAW_W / 2;
        raw[i] = (uint8_t)((180 * 4096 * 8) / (8 * 4096 + 200 * x + 100 * y));
    }
    cfg.flat_q12 = flat;
    ivl_vision_image_take(&cfg, raw, scratch, pixel);
    for (int i = 0; i < IVL_VISION_PIXELS; i++)
    {
        TEST_ASSERT_INT_WITHIN(16 * 2, 180 * 16 - 8, pixel[i]);
    }
}

static void test_rectifying_keeps_a_slope_where_it_belongs(void)
{
    ivl_vision_cfg_t cfg = vision_cfg();
    cfg.radial_q16[0] = -6554;
    for (int i = 0; i < RAW_W * RAW_H; i++)
    {
        raw[i] = (uint8_t)(i % RAW_W);
    }
    ivl_vision_image_take(&cfg, raw, scratch, pixel);
    for (int i = 0; i < IVL_VISION_PIXELS; i++)
    {
        const double u = (i % 80 - 39.5) / 45.0, v = (i / 80 - 29.5) / 45.0;
        const double expected = 79.5 + 90.0 * u * (1.0 - 6554.0 / 65536.0 * (u * u + v * v));
        TEST_ASSERT_DOUBLE_WITHIN(0.3, expected, (double)pixel[i] / 16.0);
    }
}

static void test_a_coarse_picture_has_means_and_holes(void)
{
    const int16_t fine[2 * 6] = {0, 2, 4, 8, 10, IVL_VISION_HOLE, 4, 6, 4, 8, 10, 10};
    int16_t       coarse[3];
    ivl_vision_image_halve(fine, 6, 2, coarse);
    TEST_ASSERT_EQUAL_INT16(3, coarse[0]);
    TEST_ASSERT_EQUAL_INT16(6, coarse[1]);
    TEST_ASSERT_EQUAL_INT16(IVL_VISION_HOLE, coarse[2]);
}

// ---- the map between two pictures

static ivl_vision_pair_t pair_of(const int16_t *now, const int16_t *then)
{
    const ivl_vision_cfg_t cfg = vision_cfg();
    return (ivl_vision_pair_t){now, then, 80, 60, cfg.focal_q16, cfg.centre_x_q16, cfg.centre_y_q16, 60, 48};
}

static const ivl_vision_belief_t STILL = {.turn_q30 = {1 << 30, 0, 0, 0, 1 << 30, 0, 0, 0, 1 << 30}, .normal_q30 = {0, 0, 1 << 30}};

static void test_without_motion_the_earlier_picture_is_drawn_as_it_is(void)
{
    ivl_vision_map_t        map;
    const ivl_vision_pair_t pair = pair_of(pixel, pixel);
    int16_t                 row[62];
    for (int i = 0; i < IVL_VISION_PIXELS; i++)
    {
        pixel[i] = (int16_t)(mix((uint32_t)i, 1) % 4000u);
    }
    TEST_ASSERT_TRUE(ivl_vision_map(&pair, &STILL, 9, 5, &map));
    ivl_vision_warp_row(&pair, &map, 9, 17, 62, 4096, 0, row);
    TEST_ASSERT_EQUAL_INT16_ARRAY(pixel + 17 * 80 + 9, row, 62);
    ivl_vision_warp_row(&pair, &map, 9, 17, 62, 2048, 100, row);
    TEST_ASSERT_INT_WITHIN(1, pixel[17 * 80 + 9] / 2 + 100, row[0]);
    ivl_vision_warp_row(&pair, &map, 40, 17, 62, 4096, 0, row);
    TEST_ASSERT_EQUAL_INT16(IVL_VISION_HOLE, row[61]);
}

static void test_the_map_is_that_of_the_equation(void)
{
    ivl_vision_belief_t     b = STILL;
    ivl_vision_map_t        map;
    const ivl_vision_pair_t pair = pair_of(pixel, pixel);
    const double            one = 1073741824.0, p[3] = {0.04, -0.03, 0.09}, n[3] = {0.1, 0.2, 0.9746794};
    for (int k = 0; k < 3; k++)
    {
        b.p_q30[k] = (int32_t)(p[k] * one);
        b.normal_q30[k] = (int32_t)(n[k] * one);
    }
    TEST_ASSERT_TRUE(ivl_vision_map(&pair, &b, 9, 5, &map));
    for (int i = 0; i < 20; i++)
    {
        const int    x = 10 + 3 * i, y = 6 + 2 * i;
        const double m[3] = {(x - 39.5) / 45.0, (y - 29.5) / 45.0, 1.0}, s = n[0] * m[0] + n[1] * m[1] + n[2] * m[2];
        double       at[3];
        for (int k = 0; k < 3; k++)
        {
            at[k] = (double)(map.row_q23[k][0] * x + map.row_q23[k][1] * y + map.row_q23[k][2]);
        }
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-3, 39.5 + 45.0 * (m[0] + p[0] * s) / (m[2] + p[2] * s), at[0] / at[2]);
        TEST_ASSERT_DOUBLE_WITHIN(1.0e-3, 29.5 + 45.0 * (m[1] + p[1] * s) / (m[2] + p[2] * s), at[1] / at[2]);
    }
    b.turn_q30[2] = ONE_Q30;  // far to the side: nothing of the window is in the earlier picture
    b.p_q30[0] = ONE_Q30 / 2;
    TEST_ASSERT_FALSE(ivl_vision_map(&pair, &b, 9, 5, &map));
}

// ---- approaches

static void test_cues_of_approaches_are_right_and_their_instant_is_the_middle_of_the_pair(void)
{
    const ivl_vision_cfg_t cfg = vision_cfg();
    for (int32_t slope = -3; slope <= 3; slope += 3)
    {
        TEST_ASSERT_TRUE(ivl_vision_init(&cfg, &state));
        ivl_vision_out_t out = look_at(plaster, &cfg, 0, slope);
        TEST_ASSERT_EQUAL_UINT8(IVL_VISION_FIRST, out.status);
        for (int k = 1; k < 24; k++)
        {
            out = look_at(plaster, &cfg, k, slope);
            TEST_ASSERT_EQUAL_UINT8(IVL_VISION_VALID, out.status);
            TEST_ASSERT_EQUAL_UINT8(k == 1, out.started);
            TEST_ASSERT_EQUAL_UINT32(4000000000u + (uint32_t)k * 16667u - out.gap_us / 2, out.t_us);
            const double t = (double)(uint32_t)(out.t_us - 4000000000u) * 1.0e-6, rrev = 2.5 / (1.5 - 2.5 * t);
            const double sigma = out.sigma_rrev_q16_per_s / 65536.0;
            TEST_ASSERT_DOUBLE_WITHIN(0.03 * rrev, rrev, out.rrev_q16_per_s / 65536.0);
            TEST_ASSERT_DOUBLE_WITHIN(4.0 * sigma, rrev, out.rrev_q16_per_s / 65536.0);
            TEST_ASSERT_DOUBLE_WITHIN(0.06, -rrev * slope / 4, out.of_y_q16_radps / 65536.0);
            TEST_ASSERT_DOUBLE_WITHIN(0.06, 0.0, out.of_x_q16_radps / 65536.0);
            TEST_ASSERT_TRUE(sigma > 0.0 && sigma < 0.1 * rrev);
        }
    }
}

static void test_a_slow_approach_is_seen_over_longer_pairs(void)
{
    ivl_vision_cfg_t cfg = vision_cfg();
    TEST_ASSERT_TRUE(ivl_vision_init(&cfg, &state));
    for (int k = 0; k < 4; k++)
    {
        TEST_ASSERT_EQUAL_UINT8(k, look_at(plaster, &cfg, k, 0).frames);
    }
    cfg.horizon_q12 = 40;
    TEST_ASSERT_TRUE(ivl_vision_init(&cfg, &state));
    for (int k = 0; k < 4; k++)
    {
        TEST_ASSERT_EQUAL_UINT8(k > 0, look_at(plaster, &cfg, k, 0).frames);
    }
}

static void test_a_white_wall_and_lines_say_nothing(void)
{
    const ivl_vision_cfg_t cfg = vision_cfg();
    surface_t *const       surfaces[] = {white, lines};
    for (int i = 0; i < 2; i++)
    {
        TEST_ASSERT_TRUE(ivl_vision_init(&cfg, &state));
        for (int k = 0; k < 20; k++)
        {
            const ivl_vision_out_t out = look_at(surfaces[i], &cfg, k, 1);
            assert_says_nothing(&out);
        }
    }
}

static void test_light_that_changes_from_row_to_row_changes_no_cue(void)
{
    const ivl_vision_cfg_t cfg = vision_cfg();
    TEST_ASSERT_TRUE(ivl_vision_init(&cfg, &state));
    for (int k = 0; k < 16; k++)
    {
        const int32_t way_um = (int32_t)((int64_t)SPEED_UM_PER_S * k / 60);
        draw(plaster, 0, 0, D_UM - way_um, (uint32_t)k, raw);
        for (int i = 0; i < RAW_W * RAW_H; i++)
        {
            // a parabola that wanders over the rows: 30 % of the light
            const int32_t row = (i / RAW_W + 37 * k) % 120, shade = 70 + row * (120 - row) / 120;
            raw[i] = (uint8_t)(raw[i] * shade / 100);
        }
        const ivl_vision_frame_t frame = vision_frame(raw, (uint32_t)(k * 1000000 / 60));
        ivl_vision_out_t         out;
        ivl_vision_step(&cfg, &state, &frame, &out);
        const double rrev = 2.5 / (1.5 - 2.5 * (double)out.t_us * 1.0e-6);
        if (k > 1)
        {
            TEST_ASSERT_EQUAL_UINT8(IVL_VISION_VALID, out.status);
            TEST_ASSERT_DOUBLE_WITHIN(0.06 * rrev, rrev, out.rrev_q16_per_s / 65536.0);
        }
    }
}

// ---- refusals

static void test_configurations_that_cannot_be_are_refused(void)
{
    ivl_vision_cfg_t bad[8];
    for (int i = 0; i < 8; i++)
    {
        bad[i] = vision_cfg();
    }
    bad[0].bin = 3;
    bad[1].window_w = 64;
    bad[2].window_h = 45;
    bad[3].horizon_q12 = 0;
    bad[4].focal_q16 = 0;
    bad[5].centre_x_q16 = -1;
    bad[6].radial_q16[1] = 1 << 20;
    bad[7].attitude_q16 = 65535;
    for (int i = 0; i < 8; i++)
    {
        TEST_ASSERT_FALSE(ivl_vision_init(&bad[i], &state));
    }
}

static void test_frames_that_cannot_be_are_refused_and_end_what_was_seen(void)
{
    const ivl_vision_cfg_t cfg = vision_cfg();
    for (int i = 0; i < 6; i++)
    {
        TEST_ASSERT_TRUE(ivl_vision_init(&cfg, &state));
        look_at(plaster, &cfg, 0, 0);
        TEST_ASSERT_EQUAL_UINT8(IVL_VISION_VALID, look_at(plaster, &cfg, 1, 0).status);
        ivl_vision_frame_t frame = vision_frame((i == 0) ? NULL : raw, 4000000000u + 33333u);
        frame.turn_q30[3] = (i == 1) ? ONE_Q30 / 2 : ONE_Q30;
        frame.turn_q30[0] = (i == 2) ? INT32_MIN : 0;
        frame.normal_q30[2] = (i == 3) ? -ONE_Q30 : ((i == 4) ? 0 : ONE_Q30);
        frame.exposure_us = (i == 5) ? 0 : 4000;
        ivl_vision_out_t out;
        ivl_vision_step(&cfg, &state, &frame, &out);
        TEST_ASSERT_EQUAL_UINT8(IVL_VISION_INPUT, out.status);
        assert_says_nothing(&out);
        TEST_ASSERT_EQUAL_UINT8(IVL_VISION_FIRST, look_at(plaster, &cfg, 3, 0).status);
    }
}

static void test_after_a_pause_everything_begins_anew(void)
{
    const ivl_vision_cfg_t cfg = vision_cfg();
    TEST_ASSERT_TRUE(ivl_vision_init(&cfg, &state));
    look_at(plaster, &cfg, 0, 0);
    TEST_ASSERT_EQUAL_UINT8(IVL_VISION_VALID, look_at(plaster, &cfg, 1, 0).status);
    TEST_ASSERT_EQUAL_UINT8(IVL_VISION_FIRST, look_at(plaster, &cfg, 25, 0).status);
    TEST_ASSERT_EQUAL_UINT8(IVL_VISION_FIRST, look_at(plaster, &cfg, 25, 0).status);  // the same instant twice
}

// ---- whatever comes

static void damage(rng_t *rng, ivl_vision_frame_t *frame)
{
    const uint32_t kind = rng_below(rng, 12);
    if (kind == 0)
    {
        frame->turn_q30[rng_below(rng, 4)] = (int32_t)rng_u64(rng);
    }
    if (kind == 1)
    {
        frame->normal_q30[rng_below(rng, 3)] = (int32_t)rng_u64(rng);
    }
    if (kind == 2)
    {
        frame->t_us = (uint32_t)rng_u64(rng);
    }
    if (kind == 3)
    {
        frame->exposure_us = 1u + rng_below(rng, 100000);
    }
    if (kind >= 4 && kind < 8)
    {
        const uint32_t from = rng_below(rng, RAW_W * RAW_H), n = rng_below(rng, RAW_W * RAW_H - from);
        memset(raw + from, (int)rng_below(rng, 256), n);
    }
    if (kind == 8)
    {
        for (int i = 0; i < RAW_W * RAW_H; i++)
        {
            raw[i] = (uint8_t)(((mix((uint32_t)i, (uint32_t)rng->state) >> 7) & 1u) * 255u);
        }
    }
}

static void test_whatever_comes_the_answer_is_whole(void)
{
    const ivl_vision_cfg_t cfg = vision_cfg();
    rng_t                  rng = {11};
    int                    n_valid = 0;
    for (int run = 0; run < N_VISION_FUZZ; run++)
    {
        TEST_ASSERT_TRUE(ivl_vision_init(&cfg, &state));
        const int32_t speed = (int32_t)rng_below(&rng, 8000000) - 4000000, side = (int32_t)rng_below(&rng, 4000000) - 2000000;
        for (int k = 0; k < 8; k++)
        {
            draw(plaster, side / 60 * k, 0, 700000 - speed / 60 * k, (uint32_t)k, raw);
            ivl_vision_frame_t frame = vision_frame(raw, (uint32_t)k * 16667u);
            damage(&rng, &frame);
            ivl_vision_out_t out;
            ivl_vision_step(&cfg, &state, &frame, &out);
            TEST_ASSERT_TRUE(out.status < IVL_VISION_STATUS_COUNT && out.frames < IVL_VISION_SLOTS);
            if (out.status != IVL_VISION_VALID)
            {
                assert_says_nothing(&out);
                continue;
            }
            n_valid++;
            TEST_ASSERT_TRUE(out.sigma_rrev_q16_per_s > 0 && out.sigma_of_q16_radps > 0 && out.quality > 0);
            TEST_ASSERT_TRUE(out.rrev_q16_per_s < 130 * 65536 && out.rrev_q16_per_s > -130 * 65536);
        }
    }
    TEST_ASSERT_GREATER_THAN_INT(N_VISION_FUZZ / 2, n_valid);  // it was not all garbage
}

static uint32_t with(uint32_t hash, uint32_t word)
{
    for (int i = 0; i < 4; i++)
    {
        hash = (hash ^ ((word >> (8 * i)) & 255u)) * 16777619u;
    }
    return hash;
}

static void test_the_bits_are_those_of_every_other_processor(void)
{
    const ivl_vision_cfg_t cfg = vision_cfg();
    uint32_t               hash = 2166136261u;
    TEST_ASSERT_TRUE(ivl_vision_init(&cfg, &state));
    for (int k = 0; k < 20; k++)
    {
        const ivl_vision_out_t out = look_at((k < 16) ? plaster : lines, &cfg, k, 2);
        const uint32_t words[] = {out.t_us,
                                  (uint32_t)out.rrev_q16_per_s,
                                  (uint32_t)out.of_x_q16_radps,
                                  (uint32_t)out.of_y_q16_radps,
                                  (uint32_t)out.sigma_rrev_q16_per_s,
                                  (uint32_t)out.sigma_of_q16_radps,
                                  out.gap_us,
                                  (uint32_t)out.status << 24 | (uint32_t)out.quality << 16 | (uint32_t)out.frames << 8 | out.started};
        for (size_t i = 0; i < sizeof words / sizeof words[0]; i++)
        {
            hash = with(hash, words[i]);
        }
    }
    TEST_ASSERT_EQUAL_HEX32(0x624B5B0F, hash);
}

static void test_all_memory_is_within_64_kB(void)
{
    // state, and the flat field that a camera may bring
    TEST_ASSERT_TRUE(sizeof(ivl_vision_state_t) + sizeof(uint16_t) * IVL_VISION_FLAT_ROWS * IVL_VISION_FLAT_COLUMNS <= 56000);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_shift_to_the_right_rounds_down_and_a_rounded_one_to_the_nearest);
    RUN_TEST(test_the_square_root_is_the_largest_whole_number_whose_square_is_not_above);
    RUN_TEST(test_the_motion_that_explains_all_residuals_is_found);
    RUN_TEST(test_two_terms_that_are_the_same_are_not_told_apart);
    RUN_TEST(test_a_flat_field_makes_a_shaded_wall_even);
    RUN_TEST(test_rectifying_keeps_a_slope_where_it_belongs);
    RUN_TEST(test_a_coarse_picture_has_means_and_holes);
    RUN_TEST(test_without_motion_the_earlier_picture_is_drawn_as_it_is);
    RUN_TEST(test_the_map_is_that_of_the_equation);
    RUN_TEST(test_cues_of_approaches_are_right_and_their_instant_is_the_middle_of_the_pair);
    RUN_TEST(test_a_slow_approach_is_seen_over_longer_pairs);
    RUN_TEST(test_a_white_wall_and_lines_say_nothing);
    RUN_TEST(test_light_that_changes_from_row_to_row_changes_no_cue);
    RUN_TEST(test_configurations_that_cannot_be_are_refused);
    RUN_TEST(test_frames_that_cannot_be_are_refused_and_end_what_was_seen);
    RUN_TEST(test_after_a_pause_everything_begins_anew);
    RUN_TEST(test_whatever_comes_the_answer_is_whole);
    RUN_TEST(test_the_bits_are_those_of_every_other_processor);
    RUN_TEST(test_all_memory_is_within_64_kB);
    return UNITY_END();
}
