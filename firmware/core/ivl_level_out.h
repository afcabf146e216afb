/// @file ivl_level_out.h
/// Go / no-go: the last moment at which an approach can still be called off, and how the vehicle then keeps off the ceiling.
/// Below a ceiling the vehicle first rises, level, with the least thrust that the controller can hold it level with; before what is ahead it tilts back,
/// above what is below it pushes.  "Highest" is nearest to the surface: heights are along its normal.  From the highest point on it brakes along
/// the ceiling, descends to the height at which the approach began, and hovers there.                             [MODEL section 14]
#ifndef IVL_LEVEL_OUT_H
#define IVL_LEVEL_OUT_H
#include "ivl_state.h"

/// How far the vehicle still comes towards the surface (rises, below a ceiling) from the moment at which it begins to brake.
/// @param[in] v_close_mps   closing speed at that moment; 0 or less gives 0
/// @param[in] thrust_mps2   acceleration that the rotors make at that moment, gravity included: g while the speed is held
/// @return in m, >= 0
float ivl_level_out_rise_m(const ivl_cfg_t *cfg, const ivl_surface_t *surface, float v_close_mps, float thrust_mps2);

/// An approach begins here: nothing is decided, and a level-out would come back to this height.  Until a cue is valid for the first time, the
/// ceiling is taken to be where h_ceil says.
void ivl_level_out_prepare(ivl_state_t *state);

/// Once a tick of an approach, after the policy: is go or no-go to be decided in this tick?  It is, while the ceiling comes closer, when the
/// policy would flip now, or when this is the last tick, or later, at which a level-out keeps level_margin between vehicle and ceiling.  A go at
/// the last moment stands until there is a way back again, as when the distance has become more certain.
/// Without a valid cue the last distance and speed are carried on.  [MODEL section 14]
void ivl_level_out_ask(const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_seen_t *seen);

/// Reference of this tick, in LEVEL_OUT, and in ABORTED until it rests; then advance.
ivl_reference_t ivl_level_out_next(const ivl_cfg_t *cfg, ivl_state_t *state);

/// True once the reference rests: the vehicle is to hover from now on.  Also true where no approach has begun.
bool ivl_level_out_rests(const ivl_state_t *state);
#endif  // IVL_LEVEL_OUT_H
