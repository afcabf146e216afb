/// @file ivl_root.h
/// Square root as one instruction of the processor, whatever the compiler's flags.  Pure, O(1), safe from any task.
///
/// IEEE 754 asks for the correctly rounded root, so every processor and every C library give the same bits.  Compilers know
/// that: but unless they are told that nobody reads errno (-fno-math-errno), or when they do not optimise, they call sqrtf
/// all the same, and other firmware would have to link libm.  Elsewhere than on the processors below it is sqrtf.
#ifndef IVL_ROOT_H
#define IVL_ROOT_H

#if defined(__SSE__)
#include <xmmintrin.h>
#elif !defined(__aarch64__) && !(defined(__ARM_FP) && (__ARM_FP & 4))
#include <math.h>
#endif

/// The root of x; not a number if x < 0.
static inline float ivl_sqrt(float x)
{
#if defined(__SSE__)
    return _mm_cvtss_f32(_mm_sqrt_ss(_mm_set_ss(x)));
#elif defined(__aarch64__)
    float root;
    __asm__("fsqrt %s0, %s1" : "=w"(root) : "w"(x));
    return root;
#elif defined(__ARM_FP) && (__ARM_FP & 4)
    float root;
    __asm__("vsqrt.f32 %0, %1" : "=t"(root) : "t"(x));
    return root;
#else
    return sqrtf(x);
#endif
}
#endif  // IVL_ROOT_H
