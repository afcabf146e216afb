/// @file crtp_number.h
/// Number formats of CRTP that C does not have.  Pure.
#ifndef IVL_CRTP_NUMBER_H
#define IVL_CRTP_NUMBER_H
#include <stdbool.h>
#include <stdint.h>

/// IEEE 754 binary16, rounded to nearest, ties to even; too large becomes infinite, NaN stays NaN.
uint16_t ivl_crtp_half(float value);

/// Quaternion in 32 bits: two bits say which component is largest, the others follow in order x y z w as sign and nine bits of magnitude
/// in units of sqrt(1/2) / 511; the largest is positive.  Error of a component < 0.0007, the largest < 0.0021.
/// @param[out] q  x, y, z, w; unit length
/// @return false, and q unchanged, if the bits are those of no rotation
bool ivl_crtp_quat(uint32_t bits, float q[4]);
#endif  // IVL_CRTP_NUMBER_H
