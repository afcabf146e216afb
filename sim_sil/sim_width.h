/// @file sim_width.h
/// How many rollouts stand side by side: as many as the machine's registers hold.  Their bits do not depend on it.
#ifndef IVL_SIM_WIDTH_H
#define IVL_SIM_WIDTH_H

#include <stdbool.h>

/// Rollouts that ivl_sim_fly and ivl_sim_hover step together.
int ivl_sim_width_lanes(void);

/// Holds these functions to registers of that many bits, for all threads, from their next call on.
/// @param[in] bits  128, 256 or 512; 0: the widest that the machine has, as at the start
/// @return false, with nothing changed, if the machine has none of this width
bool ivl_sim_width_use(int bits);

#endif  // IVL_SIM_WIDTH_H
