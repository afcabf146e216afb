/// @file cf_power.h
/// The battery: a voltage that falls with what was drawn and with what is being drawn.
#ifndef IVL_CF_POWER_H
#define IVL_CF_POWER_H
#include <stdbool.h>
#include <stdint.h>

typedef struct
{
    float    drawn_As;  ///< since it was full
    float    vbat_V;
    uint32_t low_ms;  ///< for how long it has been low
} ivl_cf_power_t;

/// A full battery.
void ivl_cf_power_full(ivl_cf_power_t *power);

/// @param[in] thrust_norm  total thrust as a share of the weight
/// @param[in] fixed_V      > 0: the voltage is this one
/// @param[in] low_V        at this voltage and below it is low
void ivl_cf_power_step(ivl_cf_power_t *power, float thrust_norm, float fixed_V, float low_V, uint32_t dt_ms);

/// Percent of the charge, as the voltage tells it.
uint8_t ivl_cf_power_level(const ivl_cf_power_t *power);

/// 0 on battery, 3 low for some seconds.
int8_t ivl_cf_power_state(const ivl_cf_power_t *power);

#endif  // IVL_CF_POWER_H
