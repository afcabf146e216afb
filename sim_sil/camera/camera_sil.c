#include "camera_sil.h"

#include <stdlib.h>
#include <string.h>

#include "world_rollout.h"

enum
{
    ROW_DOUBLES = 18
};

_Static_assert(sizeof(ivl_camera_row_t) == ROW_DOUBLES * sizeof(double), "a row is doubles and nothing else");
_Static_assert(sizeof(ivl_sim_look_t) == sizeof(ivl_camera_row_t), "what a world's camera is told is such a row");

const ivl_sil_field_t *ivl_sil_camera_table(uint32_t *n_fields, uint32_t *item_size)
{
#define FIELD(group, name, suffix, unit, lo, hi, dflt, doc)                                                                                \
    {#name, "f8", offsetof(ivl_camera_params_t, name##_##suffix), 1, unit, lo, hi, dflt, doc},
    static const ivl_sil_field_t FIELDS[] = {IVL_CAMERA_PARAMS(FIELD)};
#undef FIELD
    *n_fields = (uint32_t)(sizeof FIELDS / sizeof FIELDS[0]);
    *item_size = (uint32_t)sizeof(ivl_camera_params_t);
    return FIELDS;
}

const ivl_sil_field_t *ivl_sil_vision_table(uint32_t *n_fields, uint32_t *item_size)
{
#define FIELD(name, member, type, unit, doc) {name, type, offsetof(ivl_vision_out_t, member), 1, unit, 0.0, 0.0, 0.0, doc},
    static const ivl_sil_field_t FIELDS[] = {
        FIELD("t", t_us, "u4", "us", "instant of the cues") FIELD("rrev", rrev_q16_per_s, "i4", "1/s", "closing speed over distance") FIELD(
            "of_x", of_x_q16_radps, "i4", "rad/s", "flow about body x") FIELD("of_y", of_y_q16_radps, "i4", "rad/s", "flow about body y")
            FIELD("sigma_rrev", sigma_rrev_q16_per_s, "i4", "1/s", "standard deviation of RREV")
                FIELD("sigma_of", sigma_of_q16_radps, "i4", "rad/s", "standard deviation of the flow")
                    FIELD("gap", gap_us, "u4", "us", "between the two pictures") FIELD("status", status, "u1", "1", "0: valid")
                        FIELD("quality", quality, "u1", "1", "contrast over residual") FIELD("frames", frames, "u1", "1", "of the gap")
                            FIELD("started", started, "u1", "1", "1: without a prediction")};
#undef FIELD
    *n_fields = (uint32_t)(sizeof FIELDS / sizeof FIELDS[0]);
    *item_size = (uint32_t)sizeof(ivl_vision_out_t);
    return FIELDS;
}

void *ivl_sil_texture_create(const uint16_t *texels, uint32_t size, double length_m)
{
    const size_t n = (size_t)size * size;
    if (size == 0 || size > 8192 || (size & (size - 1)) != 0 || !(length_m > 0.0))
    {
        return NULL;
    }
    ivl_camera_texture_t *texture = malloc(sizeof *texture + sizeof(uint16_t) * ivl_camera_texture_texels((int)size));
    if (!texture)
    {
        return NULL;
    }
    uint16_t *own = (uint16_t *)(void *)(texture + 1);
    memcpy(own, texels, n * sizeof *own);
    ivl_camera_texture_init(own, (int)size, length_m, texture);
    return texture;
}

void ivl_sil_texture_free(void *texture)
{
    free(texture);
}

static void row_from(const double *numbers, ivl_camera_row_t *row)
{
    memcpy(row, numbers, sizeof *row);
}

int ivl_sil_camera_run(const void *params, const void *texture, const double *rows, size_t n, uint64_t seed, uint64_t stream, uint8_t *grey,
                       void *readings)
{
    const ivl_sim_rng_t rng = {seed, stream};
    ivl_camera_t       *camera = malloc(sizeof *camera);
    ivl_camera_eye_t   *eye = malloc(sizeof *eye);
    uint8_t            *own = malloc(IVL_CAMERA_WIDTH_MAX * IVL_CAMERA_HEIGHT_MAX);
    int                 result = (camera && eye && own) ? 0 : 2;
    if (result == 0 && !ivl_camera_eye_init(params, eye))
    {
        result = 1;
    }
    if (result == 0)
    {
        ivl_camera_init(params, camera);
    }
    const size_t pixels = (result == 0) ? (size_t)camera->width * (size_t)camera->height : 0;
    for (size_t i = 0; i < n && result == 0; i++)
    {
        ivl_camera_row_t row;
        uint8_t         *picture = grey ? grey + i * pixels : own;
        row_from(rows + i * ROW_DOUBLES, &row);
        ivl_camera_render(camera, texture, &row.pose, &rng, (uint32_t)i, picture);
        if (readings)
        {
            ivl_camera_eye_look(eye, picture, row.pose.t_s, row.q_told_SB, (ivl_vision_out_t *)readings + i);
        }
    }
    free(own);
    free(eye);
    free(camera);
    return result;
}

int ivl_sil_vision_run(const void *params, const uint8_t *grey, const double *rows, size_t n, void *readings)
{
    ivl_camera_eye_t *eye = malloc(sizeof *eye);
    int               result = eye ? 0 : 2;
    if (result == 0 && !ivl_camera_eye_init(params, eye))
    {
        result = 1;
    }
    const size_t pixels = (result == 0) ? (size_t)(eye->cfg.bin * eye->cfg.bin) * IVL_VISION_PIXELS : 0;
    for (size_t i = 0; i < n && result == 0; i++)
    {
        ivl_camera_row_t row;
        row_from(rows + i * ROW_DOUBLES, &row);
        ivl_camera_eye_look(eye, grey + i * pixels, row.pose.t_s, row.q_told_SB, (ivl_vision_out_t *)readings + i);
    }
    free(eye);
    return result;
}

int ivl_sil_model_camera(void *model, const void *texture)
{
    ivl_sim_model_t          *m = model;
    const ivl_camera_params_t params = ivl_camera_of_world(&m->raw);
    ivl_camera_eye_t         *eye = malloc(sizeof *eye);
    if (eye == NULL)
    {
        return 2;
    }
    const bool accepted = ivl_camera_eye_init(&params, eye);
    free(eye);
    return !accepted ? 1 : ((ivl_camera_loop_attach(texture, m) != NULL) ? 0 : 2);
}

/// A batch of one.
typedef struct
{
    ivl_sim_job_t job;
    bool          taken;
} single_t;

static bool next_of_single(void *context, ivl_sim_job_t *job)
{
    single_t  *single = context;
    const bool first = !single->taken;
    single->taken = true;
    *job = single->job;
    return first;
}

/// A copy of the model and of its camera, so that nobody else's landings are written down.
static bool fly_filmed(const ivl_sim_model_t *model, ivl_camera_film_t *film, single_t *single)
{
    ivl_sim_model_t   *own = aligned_alloc(64, (sizeof *own + 63u) & ~(size_t)63u);
    ivl_camera_loop_t *loop = malloc(sizeof *loop);
    const bool         good = own != NULL && loop != NULL;
    if (good)
    {
        memcpy(own, model, sizeof *own);
        memcpy(loop, model->eye.context, sizeof *loop);
        loop->film = film;
        ivl_camera_loop_use(loop, own);
        (void)ivl_sim_fly(own, next_of_single, single);
    }
    free(loop);
    free(own);
    return good;
}

long ivl_sil_camera_film(const void *model, const void *spec, size_t capacity, double *rows, void *readings, uint8_t *grey, void *outcome)
{
    const ivl_sim_model_t *m = model;
    single_t               single = {{spec, outcome, NULL}, false};
    ivl_camera_film_t      film = {.looks = (ivl_sim_look_t *)(void *)rows, .readings = readings, .grey = grey, .capacity = capacity};
    if (m->eye.context == NULL || !fly_filmed(m, &film, &single))
    {
        return -1;
    }
    return (long)film.n;
}
