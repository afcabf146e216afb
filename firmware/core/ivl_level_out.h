/// @file ivl_level_out.h
/// Go / no-go: the last moment at which an approach can still be called off, and how the vehicle then keeps off the ceiling.
/// The vehicle first rises, level, with the least thrust that the controller can hold it level with.  From the highest point on it brakes along
/// the ceiling, descends to the height at which the approach began, and hovers there.                             [MODEL section 14]
#ifndef IVL_LEVEL_OUT_H
#define IVL_LEVEL_OUT_H
#include "ivl_state.h"

/// How far the vehicle rises from the moment at which its thrust is reduced.
/// @param[in] v_close_mps   closing speed at that moment; 0 or less gives 0
/// @param[in] thrust_mps2   acceleration that the rotors make at that moment, gravity included: g while the speed is held
/// @return in m, >= 0
float ivl_level_out_rise_m(const ivl_cfg_t *cfg, float v_close_mps, float thrust_mps2);

/// True if this tick of an approach is the last one, or later, at which a level-out keeps level_margin between vehicle and ceiling.
bool ivl_level_out_is_last(const ivl_cfg_t *cfg, const ivl_state_t *state, const ivl_seen_t *seen);

/// True if go or no-go is to be decided in this tick: it has not been decided in this approach, and the policy would flip now, or it is the
/// last moment, while the ceiling comes closer.  Asked with a valid cue.
bool ivl_level_out_asked(const ivl_cfg_t *cfg, const ivl_state_t *state, const ivl_seen_t *seen);

/// Begin: cut the thrust and rise.
void ivl_level_out_begin(ivl_state_t *state);

/// Reference of this tick; then advance.
ivl_reference_t ivl_level_out_next(const ivl_cfg_t *cfg, ivl_state_t *state);

/// True once the reference rests: the vehicle is to hover from now on.
bool ivl_level_out_rests(const ivl_state_t *state);
#endif  // IVL_LEVEL_OUT_H
