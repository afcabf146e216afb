/// @file ivl_contact.h
/// Contact and hanging, sensed by the accelerometer on board.
#ifndef IVL_CONTACT_H
#define IVL_CONTACT_H
#include "ivl_sense.h"

typedef struct
{
    bool  contact;  ///< this tick: |f| >= contact_accel_mps2
    bool  hanging;  ///< hung_mps2 >= g/2 (upside down on a ceiling, nose up on a wall) held for hang_s
    float hang_s;   ///< how long it has held so far
} ivl_contact_t;

/// Use this tick's specific force; a tick without a fresh sample senses nothing and restarts the hang clock.
void ivl_contact_update(const ivl_cfg_t *cfg, ivl_contact_t *contact, const ivl_sense_t *sense, float dt_s);
#endif  // IVL_CONTACT_H
