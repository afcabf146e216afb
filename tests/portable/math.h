/// @file math.h
/// What the flight core may take from a C library's math.h, for targets whose library is not at hand (tools/check_portable.sh).
#ifndef PORTABLE_MATH_H
#define PORTABLE_MATH_H
float fabsf(float x);
#endif
