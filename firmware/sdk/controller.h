/// @file controller.h
/// Declared for the app: the hooks that it implements.
#ifndef SDK_CONTROLLER_H
#define SDK_CONTROLLER_H
#include "stabilizer_types.h"

void controllerOutOfTreeInit(void);
bool controllerOutOfTreeTest(void);
void controllerOutOfTree(control_t *control, const setpoint_t *setpoint, const sensorData_t *sensors, const state_t *state,
                         const stabilizerStep_t stabilizerStep);
#endif  // SDK_CONTROLLER_H
