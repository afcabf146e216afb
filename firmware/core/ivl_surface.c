/// @file ivl_surface.c
#include "ivl_surface.h"

#include "ivl_controller.h"

void ivl_surface_init(const ivl_cfg_t *cfg, ivl_surface_t *surface)
{
    const ivl_sincos_t tilt = ivl_sincos(cfg->surface_tilt_rad);
    surface->sin = tilt.sin;
    surface->cos = tilt.cos;
    surface->up_z_cut = sqrtf(0.5f * (1.0f - tilt.cos));
    // below a ceiling gravity brakes a vehicle that keeps its least lift; before what is ahead or below it tilts, or pushes
    surface->brake_mps2 = cfg->gravity_mps2 - IVL_LIFT_NORM_MIN * cfg->gravity_mps2;
    surface->late_s = 0.0f;
    surface->aside = 0.0f;
    if (cfg->surface_tilt_rad > 0.0f)
    {
        surface->brake_mps2 = cfg->approach_accel_mps2;
        // without a gain it never tilts: then an approach is decided about at once
        surface->late_s = cfg->kd_rate_xy_Nmsprad / cfg->kp_att_xy_Nmprad;
        surface->aside = ((tilt.cos < 0.0f) && (tilt.sin > -tilt.cos)) ? tilt.cos / tilt.sin : 0.0f;
    }
}

ivl_vec3_t ivl_surface_vec3(const ivl_surface_t *surface, float along, float y, float away)
{
    return (ivl_vec3_t){surface->cos * along - surface->sin * away, y, 0.0f - surface->sin * along - surface->cos * away};
}

void ivl_surface_see(const ivl_cfg_t *cfg, const ivl_surface_t *surface, const ivl_sample_t *sample, ivl_relative_t *rel)
{
    const float      s = surface->sin, c = surface->cos;
    const ivl_vec3_t v = sample->v_WB_mps, f = sample->f_B_mps2;
    const ivl_axes_t b = ivl_axes_of(sample->q_WB);
    const ivl_vec3_t normal_B = {s * b.x.x + c * b.x.z, s * b.y.x + c * b.y.z, s * b.z.x + c * b.z.z};
    rel->height_m = s * sample->p_WB_m.x + c * sample->p_WB_m.z;
    rel->close_mps = s * v.x + c * v.z;
    rel->along_mps = c * v.x - s * v.z;
    rel->facing = normal_B.z;
    rel->accel_mps2 = ivl_dot(normal_B, f) - c * cfg->gravity_mps2;
    // nose-up by the surface's angle, b_x points along (sin) and b_z against (cos) what holds the vehicle up
    rel->hung_mps2 = s * f.x - c * f.z;
}
