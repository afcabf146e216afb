/// @file ivl_contact.c
#include "ivl_contact.h"

#include "ivl_math.h"

void ivl_contact_update(const ivl_cfg_t *cfg, ivl_contact_t *contact, const ivl_sense_t *sense, float dt_s)
{
    const ivl_vec3_t f = sense->sample.f_B_mps2;
    const bool       reversed = sense->pose_fresh && (sense->rel.hung_mps2 >= 0.5f * cfg->gravity_mps2);
    contact->contact = sense->pose_fresh && (ivl_dot(f, f) >= cfg->contact_accel_mps2 * cfg->contact_accel_mps2);
    contact->hang_s = reversed ? contact->hang_s + dt_s : 0.0f;
    contact->hanging = contact->hang_s >= cfg->hang_s;
}
