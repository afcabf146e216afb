#include "camera_render.h"

#include <math.h>

#include "phys_math.h"

enum
{
    SAMPLES_MAX = 16,
    INTERLEAVED = 4,  ///< instants that 2 x 2 pixels share
    UNDISTORT_ITERATIONS = 20
};

/// Where a picture's noise begins among the draws; the shots of a row follow each other.
static const ivl_sim_draw_t DRAW_PICTURE = (ivl_sim_draw_t)(IVL_SIM_DRAW_FURTHER + 2);

/// Map from a pixel's direction to a texel at one instant: numerators and denominator are linear in it.
typedef struct
{
    float x[3], y[3], over[3];
} map_t;

/// Rotation about x, then about y, of small angles that are given exactly.
static void mount(double roll, double pitch, double R_BC[3][3])
{
    double sr, cr, sp, cp;
    ivl_sim_sincos(roll, &sr, &cr);
    ivl_sim_sincos(pitch, &sp, &cp);
    const double R[3][3] = {{cp, sp * sr, sp * cr}, {0.0, cr, -sr}, {-sp, cp * sr, cp * cr}};
    memcpy(R_BC, R, sizeof R);
}

double ivl_camera_undistorted(const ivl_camera_params_t *p, double r2)
{
    double s = 1.0;
    for (int i = 0; i < UNDISTORT_ITERATIONS; i++)
    {
        const double q = s * s * r2;
        s = 1.0 / (1.0 + q * (p->radial_1_norm + q * p->radial_2_norm));
    }
    return s;
}

void ivl_camera_init(const ivl_camera_params_t *params, ivl_camera_t *camera)
{
    camera->params = *params;
    camera->width = (params->width_px > 240.0) ? 320 : 160;
    camera->height = camera->width * 3 / 4;
    mount(params->mount_roll_rad, params->mount_pitch_rad, camera->R_BC);
    for (int y = 0; y < camera->height; y++)
    {
        for (int x = 0; x < camera->width; x++)
        {
            const double u = (x - 0.5 * (camera->width - 1)) / params->focal_px, v = (y - 0.5 * (camera->height - 1)) / params->focal_px;
            const double s = ivl_camera_undistorted(params, u * u + v * v), fall = 1.0 + params->vignetting_norm * s * s * (u * u + v * v);
            const int    at = y * camera->width + x;
            camera->u[at] = (float)(s * u);
            camera->v[at] = (float)(s * v);
            camera->light[at] = (float)(1.0 / (fall * fall));
        }
    }
    for (int grey = 0; grey < 256; grey++)
    {
        const double light = (grey > params->black_norm) ? grey - params->black_norm : 0.0;
        camera->noise[grey] = (float)sqrt(light / params->electrons_per_grey_norm + params->read_noise_norm * params->read_noise_norm);
    }
}

/// Light of an exposure around t, over its mean: the flicker's mean over the exposure.
static double flicker(const ivl_camera_params_t *p, double t_s)
{
    if (!(p->flicker_norm > 0.0))
    {
        return 1.0;
    }
    double       s, c, half_s, half_c;
    const double half = IVL_SIM_PI * p->flicker_rate_hz * p->exposure_s;
    ivl_sim_sincos(2.0 * IVL_SIM_PI * p->flicker_rate_hz * t_s, &s, &c);
    ivl_sim_sincos(half, &half_s, &half_c);
    return 1.0 + p->flicker_norm * c * half_s / half;
}

/// The map at `dt_s` after the middle of the picture.
static map_t look(const ivl_camera_t *camera, const ivl_camera_texture_t *texture, const ivl_camera_pose_t *pose, double dt_s)
{
    const ivl_rot_t R = ivl_rot_from_quat(pose->q_SB);
    const double    wx = pose->w_B_radps[0] * dt_s, wy = pose->w_B_radps[1] * dt_s, wz = pose->w_B_radps[2] * dt_s;
    const double    h = camera->params.mount_height_m;
    double          axis[3][3], lift[3];
    // columns of R_SB (1 + w x) R_BC, and the way from body to camera
    for (int k = 0; k < 3; k++)
    {
        const double c[3] = {camera->R_BC[0][k], camera->R_BC[1][k], camera->R_BC[2][k]};
        const double turned[3] = {c[0] + wy * c[2] - wz * c[1], c[1] + wz * c[0] - wx * c[2], c[2] + wx * c[1] - wy * c[0]};
        ivl_d3_store(axis[k], ivl_rot_apply(&R, ivl_d3_load(turned)));
    }
    const double up[3] = {h * wy, -h * wx, h};
    ivl_d3_store(lift, ivl_rot_apply(&R, ivl_d3_load(up)));
    double p[3];
    for (int i = 0; i < 3; i++)
    {
        p[i] = pose->p_SB_m[i] + lift[i] + pose->v_SB_mps[i] * dt_s;
    }
    // p + d axis / axis_z with d = -p_z: one fraction
    map_t map;
    for (int k = 0; k < 3; k++)
    {
        map.x[k] = (float)((p[0] * axis[k][2] - p[2] * axis[k][0]) * texture->texels_per_m);
        map.y[k] = (float)((p[1] * axis[k][2] - p[2] * axis[k][1]) * texture->texels_per_m);
        map.over[k] = (float)axis[k][2];
    }
    return map;
}

/// What lies on the plane: the board, and what is beyond it.
typedef struct
{
    float x_lo, x_hi, y_lo, y_hi;  ///< texels
    bool  ends;
    float background, level;
} board_t;

static board_t board_of(const ivl_camera_t *camera, const ivl_camera_texture_t *texture, const ivl_camera_pose_t *pose)
{
    const ivl_camera_params_t *p = &camera->params;
    const double               k = texture->texels_per_m, far = 1.0e9;
    board_t                    board = {.ends = p->board_x_m > 0.0 || p->board_y_m > 0.0, .background = (float)p->background_norm};
    const double half_x = (p->board_x_m > 0.0) ? 0.5 * p->board_x_m : far, half_y = (p->board_y_m > 0.0) ? 0.5 * p->board_y_m : far;
    board.x_lo = (float)((p->board_at_x_m - half_x) * k);
    board.x_hi = (float)((p->board_at_x_m + half_x) * k);
    board.y_lo = (float)((p->board_at_y_m - half_y) * k);
    board.y_hi = (float)((p->board_at_y_m + half_y) * k);
    // footprint of a pixel in texels; its binary logarithm without the C library
    double footprint = -pose->p_SB_m[2] / p->focal_px * k;
    int    whole = 0;
    for (; footprint >= 2.0 && whole < IVL_CAMERA_TEXTURE_LEVELS; whole++)
    {
        footprint *= 0.5;
    }
    board.level = (float)whole + (float)((footprint > 1.0) ? footprint - 1.0 : 0.0);
    return board;
}

static float brightness(const ivl_camera_texture_t *texture, const board_t *board, const map_t *map, float u, float v)
{
    const float over = map->over[0] * u + map->over[1] * v + map->over[2];
    if (!(over > 0.01f))
    {
        return board->background;
    }
    const float x = (map->x[0] * u + map->x[1] * v + map->x[2]) / over, y = (map->y[0] * u + map->y[1] * v + map->y[2]) / over;
    if (!(x > -1.0e6f && x < 1.0e6f && y > -1.0e6f && y < 1.0e6f) ||
        (board->ends && (x < board->x_lo || x > board->x_hi || y < board->y_lo || y > board->y_hi)))
    {
        return board->background;
    }
    return ivl_camera_texture_look(texture, x + texture->at_x_texel, y + texture->at_y_texel, board->level);
}

static uint8_t to_grey(float value)
{
    return (uint8_t)((value > 254.5f) ? 255.0f : ((value < 0.0f) ? 0.0f : value + 0.5f));
}

/// Philox4x32-10 of counters that differ in their first word, as ivl_sim_philox gives it; written so that a compiler does several at once.
static void philox_row(uint32_t first, const ivl_sim_rng_t *rng, int n, uint32_t bits[4][IVL_CAMERA_WIDTH_MAX / 4])
{
    uint32_t k0 = (uint32_t)rng->seed, k1 = (uint32_t)(rng->seed >> 32);
    for (int i = 0; i < n; i++)
    {
        bits[0][i] = first + (uint32_t)i;
        bits[1][i] = (uint32_t)DRAW_PICTURE;
        bits[2][i] = (uint32_t)rng->stream;
        bits[3][i] = (uint32_t)(rng->stream >> 32);
    }
    for (int round = 0; round < 10; round++)
    {
        for (int i = 0; i < n; i++)
        {
            const uint64_t p0 = (uint64_t)0xD2511F53u * bits[0][i], p1 = (uint64_t)0xCD9E8D57u * bits[2][i];
            bits[0][i] = (uint32_t)(p1 >> 32) ^ bits[1][i] ^ k0;
            bits[2][i] = (uint32_t)(p0 >> 32) ^ bits[3][i] ^ k1;
            bits[1][i] = (uint32_t)p1;
            bits[3][i] = (uint32_t)p0;
        }
        k0 += 0x9E3779B9u;
        k1 += 0xBB67AE85u;
    }
}

/// Sums of four random bytes are nearly normal; their standard deviation is 147.8.
static void add_noise(const ivl_camera_t *camera, const ivl_sim_rng_t *rng, uint32_t picture, int row, const float *clean, uint8_t *grey)
{
    uint32_t       bits[4][IVL_CAMERA_WIDTH_MAX / 4];
    const uint32_t first = picture * (uint32_t)(IVL_CAMERA_WIDTH_MAX * IVL_CAMERA_HEIGHT_MAX / 4) + (uint32_t)(row * camera->width) / 4u;
    philox_row(first, rng, camera->width / 4, bits);
    for (int x = 0; x < camera->width; x++)
    {
        const uint32_t b = bits[x & 3][x / 4], sum = (b & 255u) + ((b >> 8) & 255u) + ((b >> 16) & 255u) + (b >> 24);
        const float    value = clean[x];
        grey[x] = to_grey(value + camera->noise[to_grey(value)] * ((float)sum - 510.0f) * (1.0f / 147.8f));
    }
}

/// Instants of the exposure of a row, as maps; with interleaved ones, which of them a pixel takes changes over 2 x 2 pixels.
static int look_through_row(const ivl_camera_t *camera, const ivl_camera_texture_t *texture, const ivl_camera_pose_t *pose, double row_s,
                            map_t maps[SAMPLES_MAX])
{
    const int asked = (int)camera->params.blur_norm, n = (asked > 0) ? asked : INTERLEAVED;
    for (int i = 0; i < n; i++)
    {
        maps[i] = look(camera, texture, pose, row_s + ((i + 0.5) / n - 0.5) * camera->params.exposure_s);
    }
    return asked;
}

/// One instant a pixel: of a row, the even pixels take one and the odd ones the other.
static void brightness_of_row(const ivl_camera_t *camera, const ivl_camera_texture_t *texture, const board_t *board, const map_t *even,
                              const map_t *odd, const float *u, const float *v, float *out)
{
    ivl_camera_four_t mx[3], my[3], over[3];
    for (int k = 0; k < 3; k++)
    {
        mx[k] = (ivl_camera_four_t){even->x[k], odd->x[k], even->x[k], odd->x[k]};
        my[k] = (ivl_camera_four_t){even->y[k], odd->y[k], even->y[k], odd->y[k]};
        over[k] = (ivl_camera_four_t){even->over[k], odd->over[k], even->over[k], odd->over[k]};
    }
    const float far = 1.0e6f;
    for (int i = 0; i < camera->width; i += 4)
    {
        ivl_camera_four_t pu, pv;
        memcpy(&pu, u + i, sizeof pu);
        memcpy(&pv, v + i, sizeof pv);
        const ivl_camera_four_t  w = over[0] * pu + over[1] * pv + over[2];
        const ivl_camera_four_t  x = (mx[0] * pu + mx[1] * pv + mx[2]) / w, y = (my[0] * pu + my[1] * pv + my[2]) / w;
        const ivl_camera_whole_t sees = (w > 0.01f) & (x > -far) & (x < far) & (y > -far) & (y < far);
        if (board->ends || (sees[0] & sees[1] & sees[2] & sees[3]) == 0)
        {
            for (int j = 0; j < 4; j++)
            {
                out[i + j] = brightness(texture, board, (j & 1) ? odd : even, u[i + j], v[i + j]);
            }
            continue;
        }
        const ivl_camera_four_t look =
            ivl_camera_texture_look_four(texture, x + texture->at_x_texel, y + texture->at_y_texel, board->level);
        memcpy(out + i, &look, sizeof look);
    }
}

/// The mean of all instants for each pixel.
static void mean_of_row(const ivl_camera_t *camera, const ivl_camera_texture_t *texture, const board_t *board, const map_t *maps, int n,
                        const float *u, const float *v, float *out)
{
    for (int x = 0; x < camera->width; x++)
    {
        float sum = 0.0f;
        for (int i = 0; i < n; i++)
        {
            sum += brightness(texture, board, &maps[i], u[x], v[x]);
        }
        out[x] = sum / (float)n;
    }
}

void ivl_camera_render(const ivl_camera_t *camera, const ivl_camera_texture_t *texture, const ivl_camera_pose_t *pose,
                       const ivl_sim_rng_t *rng, uint32_t picture, uint8_t *grey)
{
    const board_t board = board_of(camera, texture, pose);
    for (int y = 0; y < camera->height; y++)
    {
        // the rows of a 2 x 2 block take the instants 0, 2 and 3, 1: the mean of a block has no preferred direction in time
        static const int TURN[2][2] = {{0, 2}, {3, 1}};
        const double     row_s = (y - 0.5 * (camera->height - 1)) * camera->params.row_time_s;
        const float  light = (float)((camera->params.white_norm - camera->params.black_norm) * flicker(&camera->params, pose->t_s + row_s));
        const float *u = camera->u + y * camera->width, *v = camera->v + y * camera->width, *fall = camera->light + y * camera->width;
        map_t        maps[SAMPLES_MAX];
        const int    n = look_through_row(camera, texture, pose, row_s, maps), *turn = TURN[y & 1];
        float        clean[IVL_CAMERA_WIDTH_MAX];
        if (n > 0)
        {
            mean_of_row(camera, texture, &board, maps, n, u, v, clean);
        }
        else
        {
            brightness_of_row(camera, texture, &board, &maps[turn[0]], &maps[turn[1]], u, v, clean);
        }
        for (int x = 0; x < camera->width; x++)
        {
            clean[x] = (float)camera->params.black_norm + light * fall[x] * clean[x];
        }
        add_noise(camera, rng, picture, y, clean, grey + y * camera->width);
    }
}
