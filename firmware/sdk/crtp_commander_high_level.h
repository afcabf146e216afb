/// @file crtp_commander_high_level.h
/// Declared for the app: the planner of the SDK.
#ifndef SDK_CRTP_COMMANDER_HIGH_LEVEL_H
#define SDK_CRTP_COMMANDER_HIGH_LEVEL_H
#include <stdbool.h>

bool crtpCommanderHighLevelIsStopped(void);
int  crtpCommanderHighLevelGoTo(const float x, const float y, const float z, const float yaw, const float duration_s, const bool relative);
#endif  // SDK_CRTP_COMMANDER_HIGH_LEVEL_H
