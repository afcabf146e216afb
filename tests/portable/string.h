/// @file string.h
/// What the flight core may take from a C library's string.h, for targets whose library is not at hand (tools/check_portable.sh).
#ifndef PORTABLE_STRING_H
#define PORTABLE_STRING_H
#include <stddef.h>
void *memcpy(void *to, const void *from, size_t n);
void *memmove(void *to, const void *from, size_t n);
void *memset(void *to, int byte, size_t n);
int   memcmp(const void *a, const void *b, size_t n);
#endif
