/// @file cf_stock.h
/// The stock controller: follows a set-point.  Its law is the core's tracking controller, seen from axes that turn with the wanted heading.
#ifndef IVL_CF_STOCK_H
#define IVL_CF_STOCK_H
#include "cf_commander.h"
#include "ivl.h"

typedef struct
{
    bool       running;  ///< the last set-point asked for thrust
    float      yaw_rad;  ///< wanted heading
    ivl_vec3_t p_W_m;    ///< wanted position; where only a velocity is wanted, it moves along
    float      roll, pitch;
} ivl_cf_stock_t;

/// Forget what was flown before.
void ivl_cf_stock_reset(ivl_cf_stock_t *stock);

/// Motor thrusts for a set-point.
/// @param[in] sample  sensed state
void ivl_cf_stock_step(ivl_cf_stock_t *stock, const ivl_cfg_t *cfg, const ivl_sample_t *sample, const ivl_cf_setpoint_t *setpoint,
                       float dt_s, float thrust_N[4]);

/// Heading of an attitude: of b_x in the horizontal plane.
float ivl_cf_yaw_of(ivl_quat_t q_WB);

#endif  // IVL_CF_STOCK_H
