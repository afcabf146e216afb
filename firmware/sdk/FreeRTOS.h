/// @file FreeRTOS.h
/// Declared for the app: ticks of the kernel are milliseconds.
#ifndef SDK_FREERTOS_H
#define SDK_FREERTOS_H
#include <stdint.h>

typedef uint32_t TickType_t;

#define M2T(ms)    ((unsigned int)(ms))
#define T2M(ticks) ((unsigned int)(ticks))
#endif  // SDK_FREERTOS_H
