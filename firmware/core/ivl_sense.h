/// @file ivl_sense.h
/// Stage 1: the sensed state and the command, checked.  Each is taken as a whole or not at all; the last good one is kept.
#ifndef IVL_SENSE_H
#define IVL_SENSE_H
#include "ivl_surface.h"

// limits beyond which a value is called impossible; all are far outside what the vehicle can do
#define IVL_SENSE_P_M_MAX     200.0f   ///< m, each coordinate
#define IVL_SENSE_V_MPS_MAX   50.0f    ///< m/s, each component
#define IVL_SENSE_W_RADPS_MAX 1000.0f  ///< rad/s, each component
#define IVL_SENSE_F_MPS2_MAX  1.0e6f   ///< m/s^2, each component; high, since an impact is a spike
#define IVL_SENSE_Q_NORM2_TOL 0.05f    ///< |q|^2 may differ from 1 by this much; it is normalised

/// The input of one tick: now, one sensed state, one command, and how the vehicle is.
typedef struct
{
    uint64_t      t_us;       ///< now; must advance from tick to tick
    uint64_t      t_pose_us;  ///< sampling instant of p, v
    ivl_vec3_t    p_WB_m;
    ivl_vec3_t    v_WB_mps;
    ivl_quat_t    q_WB;
    ivl_vec3_t    w_B_radps;
    ivl_vec3_t    f_B_mps2;  ///< specific force (accelerometer)
    ivl_command_t cmd;
    ivl_vitals_t  vitals;
    ivl_reading_t rrev;   ///< 1/s, positive while the ceiling comes closer: a camera's
    ivl_reading_t range;  ///< m, along b_z: a ranging sensor's that faces up
    ivl_reading_t flow;   ///< rad/s, as OF_y: a flow sensor's that faces up
} ivl_in_t;

typedef struct
{
    ivl_sample_t   sample;       ///< the last good sensed state, its quaternion normalised
    ivl_command_t  cmd;          ///< the last good command
    float          age_s;        ///< age of the sample's position; grows by one tick per tick without a good one
    float          up_z;         ///< z component in W of b_z: cosine of the tilt
    ivl_relative_t rel;          ///< the sample, as seen from the surface (ivl_surface.h)
    uint64_t       t_last_us;    ///< clock of the previous tick
    float          cmd_age_s;    ///< time since the last good command
    bool           pose_fresh;   ///< the sample is this tick's
    bool           pose_usable;  ///< the sample is not older than stale_s_max
    bool           cmd_fresh;    ///< the command is this tick's
    bool           cmd_usable;   ///< the command is not older than stale_s_max
} ivl_sense_t;

/// No sample, request IDLE.
void ivl_sense_reset(ivl_sense_t *sense);

/// True if a command makes sense: a request that exists, and the arguments that it uses within their ranges.
bool ivl_sense_command_good(const ivl_cfg_t *cfg, const ivl_command_t *cmd);

/// Take in one tick.  State and command are independent: an abort arrives even if the sensed state is bad, and the vehicle is kept
/// level even if the command is.
/// @param[in] dt_s  tick period, s
void ivl_sense_update(const ivl_cfg_t *cfg, ivl_sense_t *sense, const ivl_in_t *in, float dt_s);
#endif  // IVL_SENSE_H
