// the core's headers and sources, with numbers of several vehicles in them; nothing else of the world may be included here
#define IVL_NUM_FILE "world_num.h"
#include "world_drive.h"

#include "ivl_controller.c"
#include "ivl_mixer.c"

IVL_SIM_INLINE ivl_vec3_t vec3(ivl_s3_t a)
{
    return ivl_vec3(a.x, a.y, a.z);
}

void ivl_sim_drive(const ivl_cfg_t *cfg, ivl_sim_drive_t *drive)
{
    const ivl_sample_t    sample = {.p_WB_m = vec3(drive->p_WB_m),
                                    .v_WB_mps = vec3(drive->v_WB_mps),
                                    .q_WB = {drive->q_WB[0], drive->q_WB[1], drive->q_WB[2], drive->q_WB[3]},
                                    .w_B_radps = vec3(drive->w_B_radps)};
    const ivl_reference_t ref = {vec3(drive->p_ref_W_m), vec3(drive->v_ref_W_mps), vec3(drive->a_ref_W_mps2)};
    const ivl_wrench_t    wrench = ivl_controller_compute(cfg, &sample, &ref, drive->tan_tilt_max);
    ivl_mixer_thrusts(cfg, &wrench, drive->thrust_N);
}
