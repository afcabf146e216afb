/// @file app_supervisor.c
/// The tumble check of the SDK's supervisor.  It would cut a vehicle that coasts upside down, and it is what disarms one that hangs.
/// Its switch is a persistent parameter (supervisor.tmblChckEn).  Only the variable behind it is written here, nothing is stored; since every
/// tick writes it, neither a host that dies in the middle of a run nor a stored 0 leaves the check off.
#include "app_ivl.h"

extern uint8_t tumbleCheckEnabled;

void app_tumble_check_set(ivl_phase_t phase)
{
    const bool is_off = (phase == IVL_PHASE_FLIP) || (phase == IVL_PHASE_COAST);
    tumbleCheckEnabled = (uint8_t)(is_off ? 0u : 1u);
}
