/// @file task.h
/// Declared for the app: the kernel's clock and delay.
#ifndef SDK_TASK_H
#define SDK_TASK_H
#include "FreeRTOS.h"

TickType_t xTaskGetTickCount(void);
void       vTaskDelay(TickType_t ticks);
#endif  // SDK_TASK_H
