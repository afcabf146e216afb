/// @file commander.h
/// Declared for the app: let any later set-point replace the present one.
#ifndef SDK_COMMANDER_H
#define SDK_COMMANDER_H
void commanderRelaxPriority(void);
#endif  // SDK_COMMANDER_H
