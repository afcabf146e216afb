/// @file stdlib.h
/// What clang's own xmmintrin.h asks for, where the C library is not at hand.  The flight core calls none of it, which
/// tools/check_portable.sh checks.
#ifndef PORTABLE_STDLIB_H
#define PORTABLE_STDLIB_H
#include <stddef.h>
void *malloc(size_t n);
void  free(void *memory);
#endif
