#include "camera_loop.h"

#include <stdlib.h>
#include <string.h>

static const double ONE_Q16 = 65536.0, US = 1.0e-6;

/// One lane: an estimator that has its own memory, and the place of the surface at which this landing begins.
typedef struct
{
    ivl_camera_eye_t     eye;
    ivl_camera_texture_t texture;
    ivl_sim_rng_t        rng;
} lane_t;

typedef struct
{
    const ivl_camera_loop_t *loop;
    uint8_t                  grey[IVL_CAMERA_WIDTH_MAX * IVL_CAMERA_HEIGHT_MAX];
    lane_t                   lane[];
} port_t;

/// Without memory there is no port, and no landing has a reading.
static void *open_port(void *context, int lanes)
{
    port_t *port = malloc(sizeof *port + (size_t)lanes * sizeof port->lane[0]);
    if (port != NULL)
    {
        port->loop = context;
    }
    return port;
}

static void close_port(void *port)
{
    free(port);
}

static void start(void *port, int number, const ivl_sim_rng_t *rng)
{
    const ivl_camera_loop_t *loop = ((port_t *)port)->loop;
    lane_t                  *lane = &((port_t *)port)->lane[number];
    const double             size = (double)loop->texture.size;
    (void)ivl_camera_eye_init(&loop->camera.params, &lane->eye);  // was asked when the loop was made
    lane->rng = *rng;
    lane->texture = loop->texture;
    lane->texture.at_x_texel = (float)(size * ivl_sim_uniform(rng, IVL_SIM_DRAW_SIGHT_PLACE, 0));
    lane->texture.at_y_texel = (float)(size * ivl_sim_uniform(rng, IVL_SIM_DRAW_SIGHT_PLACE, 1));
}

static ivl_camera_pose_t pose_of(const ivl_sim_look_t *at)
{
    ivl_camera_pose_t pose = {.t_s = at->t_s};
    memcpy(pose.p_SB_m, at->p_SB_m, sizeof pose.p_SB_m);
    memcpy(pose.q_SB, at->q_SB, sizeof pose.q_SB);
    memcpy(pose.v_SB_mps, at->v_SB_mps, sizeof pose.v_SB_mps);
    memcpy(pose.w_B_radps, at->w_B_radps, sizeof pose.w_B_radps);
    return pose;
}

static void write_down(ivl_camera_film_t *film, const ivl_sim_look_t *at, const ivl_vision_out_t *reading, const uint8_t *grey,
                       size_t pixels)
{
    if (film->n < film->capacity)
    {
        film->looks[film->n] = *at;
        film->readings[film->n] = *reading;
        if (film->grey != NULL)
        {
            memcpy(film->grey + film->n * pixels, grey, pixels);
        }
    }
    film->n++;
}

static void look(void *port, int number, uint32_t picture, const ivl_sim_look_t *at, ivl_sim_seen_t *seen)
{
    port_t                  *p = port;
    lane_t                  *lane = &p->lane[number];
    const ivl_camera_loop_t *loop = p->loop;
    const ivl_camera_pose_t  pose = pose_of(at);
    ivl_vision_out_t         reading;
    ivl_camera_render(&loop->camera, &lane->texture, &pose, &lane->rng, picture, p->grey);
    ivl_camera_eye_look(&lane->eye, p->grey, at->t_s, at->q_told_SB, &reading);
    seen->valid = reading.status == (uint8_t)IVL_VISION_VALID;
    const uint32_t now_us = (uint32_t)(at->t_s / US + 0.5);
    seen->age_s = seen->valid ? US * (double)(now_us - reading.t_us) : 0.5 * loop->period_s;
    seen->rrev_per_s = (double)reading.rrev_q16_per_s / ONE_Q16;
    seen->of_y_radps = (double)reading.of_y_q16_radps / ONE_Q16;
    if (loop->film != NULL)
    {
        write_down(loop->film, at, &reading, p->grey, (size_t)loop->camera.width * (size_t)loop->camera.height);
    }
}

ivl_camera_params_t ivl_camera_of_world(const ivl_sim_params_t *raw)
{
    return (ivl_camera_params_t){
#define MEMBER(group, name, suffix, unit, lo, hi, dflt, doc) .name##_##suffix = raw->group##_##name##_##suffix,
        IVL_CAMERA_PARAMS(MEMBER)
#undef MEMBER
    };
}

void ivl_camera_loop_use(ivl_camera_loop_t *loop, ivl_sim_model_t *model)
{
    model->eye = (ivl_sim_eye_t){.context = loop, .open = open_port, .close = close_port, .start = start, .look = look};
}

ivl_camera_loop_t *ivl_camera_loop_attach(const ivl_camera_texture_t *texture, ivl_sim_model_t *model)
{
    ivl_camera_loop_t *loop = malloc(sizeof *loop);
    if (loop != NULL)
    {
        const ivl_camera_params_t params = ivl_camera_of_world(&model->raw);
        ivl_camera_init(&params, &loop->camera);
        loop->texture = *texture;
        loop->period_s = 1.0 / model->raw.camera_rate_hz;
        loop->film = NULL;
        ivl_camera_loop_use(loop, model);
    }
    return loop;
}
