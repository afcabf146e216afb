/// @file memory.c
/// The two functions of the C library that the estimator calls, for programs without one.
#include <string.h>

void *memcpy(void *restrict to, const void *restrict from, size_t n)
{
    unsigned char       *t = to;
    const unsigned char *f = from;
    while (n-- > 0)
    {
        *t++ = *f++;
    }
    return to;
}

void *memset(void *at, int value, size_t n)
{
    unsigned char *a = at;
    while (n-- > 0)
    {
        *a++ = (unsigned char)value;
    }
    return at;
}
