/// @file supervisor.h
/// Declared for the app: whether the SDK's supervisor lets the motors run.
#ifndef SDK_SUPERVISOR_H
#define SDK_SUPERVISOR_H
#include <stdbool.h>

bool supervisorCanFly(void);
#endif  // SDK_SUPERVISOR_H
