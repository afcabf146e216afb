/// @file usec_time.h
/// Declared for the app: the clock.
#ifndef SDK_USEC_TIME_H
#define SDK_USEC_TIME_H
#include <stdint.h>

uint64_t usecTimestamp(void);
#endif  // SDK_USEC_TIME_H
