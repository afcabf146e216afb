/// @file string.h
/// What the estimator needs of the C library, for processors whose compiler comes without one.  Defined in memory.c.
#ifndef VISION_STRING_H
#define VISION_STRING_H

#include <stddef.h>

void *memcpy(void *restrict to, const void *restrict from, size_t n);
void *memset(void *at, int value, size_t n);

#endif  // VISION_STRING_H
