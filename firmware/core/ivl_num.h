/// @file ivl_num.h
/// The numbers of stages that are pure arithmetic.  On the vehicle a number is a float.  A simulator compiles the same sources once more, with
/// numbers that are those of several vehicles side by side: IVL_NUM_FILE then says what the names below mean.
#ifndef IVL_NUM_H
#define IVL_NUM_H
#ifdef IVL_NUM_FILE
#include IVL_NUM_FILE
#else
#include <math.h>

typedef float ivl_num_t;

/// A constant as a number.
#define ivl_num(x)                   (x)

/// One of two numbers.  Which of them are computed is not said: both must be harmless.
#define ivl_pick(condition, yes, no) ((condition) ? (yes) : (no))

#define ivl_root(x)      sqrtf(x)
#define ivl_magnitude(x) fabsf(x)
#endif
#endif  // IVL_NUM_H
