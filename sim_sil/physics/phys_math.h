/// @file phys_math.h
/// Elementary functions of the simulator, of one number and of several rollouts side by side.
///
/// Only + - * / and sqrt, which IEEE 754 rounds correctly everywhere, so that a rollout has the same bits on every host:
/// the functions of libm differ between C libraries.  Double precision, SI, radians.  Pure, no state.
#ifndef IVL_PHYS_MATH_H
#define IVL_PHYS_MATH_H

#include <math.h>
#include <string.h>

#include "phys_vector.h"
#include "phys_wide.h"

static const double IVL_SIM_PI = 3.14159265358979323846;

enum
{
    IVL_SIM_ANGLES_MAX = 8  ///< angles that are unfolded at once: two hinges of each leg
};

// Polynomials below: interpolation of the function at Chebyshev nodes, computed with 40 digits; the stated error is that
// of the polynomial, the rounding of double comes on top.

/// atan(t) / t as a polynomial in t^2, |t| <= tan(pi/8), error 3.5e-17
static const double IVL_SIM_ATAN[11] = {0.99999999999999996532,   -0.33333333333328438572,  0.19999999998855110134,
                                        -0.1428571418097646683,   0.1111110618045594522,    -0.090907730748084137897,
                                        0.076899534963068577563,  -0.066402339304294085887, 0.056883492268090104794,
                                        -0.043480522157164624777, 0.021135373157693245206};
/// exp(x), |x| <= ln(2)/2, error 4.2e-18
static const double IVL_SIM_EXP[12] = {0.99999999999999999693,   0.99999999999999999976,    0.50000000000000183855,
                                       0.16666666666666680806,   0.041666666666488095495,   0.0083333333333196006109,
                                       0.0013888888952314774652, 0.00019841269890047113707, 2.4801485482328492419e-5,
                                       2.7557240918578969823e-6, 2.7632639639041029749e-7,  2.5110037605963777712e-8};
/// sin(x) / x and cos(x) as polynomials in x^2, |x| <= pi/4, errors 3.2e-18 and 3.0e-20
static const double IVL_SIM_SIN[7] = {0.99999999999999999685,     -0.16666666666666616666,  0.0083333333333203624567,
                                      -0.00019841269828650300013, 2.7557313376400129128e-6, -2.5050716974102745028e-8,
                                      1.5894736651849095259e-10};
static const double IVL_SIM_COS[8] = {0.99999999999999999997,    -0.49999999999999999371,   0.041666666666666452389,
                                      -0.0013888888888861094596, 2.4801587283881153004e-5,  -2.7557313097790086271e-7,
                                      2.0875582380663953044e-9,  -1.1353379638297574126e-11};
/// atanh(s) / s as a polynomial in s^2, |s| <= (sqrt 2 - 1)/(sqrt 2 + 1), error 1.2e-18
static const double IVL_SIM_ATANH[8] = {0.99999999999999999887, 0.33333333333333822829,  0.19999999999651169056, 0.14285714380320839941,
                                        0.11111098528363023304, 0.090918158401146644019, 0.07656264074182095483, 0.074048551803276383491};

/// An angle whose arcus tangent is still to be taken: atan2 up to its one division, num / den in [-0.42, 0.42].
typedef struct
{
    ivl_wide_t num, den;
    ivl_mask_t swap, turn, mirror, negative;
} ivl_angle_t;

/// Folds the point (c, s) into the first octant; beyond tan(pi/8) turns it by pi/4.  den > 0 always.
IVL_SIM_INLINE ivl_angle_t ivl_wide_fold(ivl_wide_t s, ivl_wide_t c)
{
    const ivl_wide_t zero = ivl_wide(0.0);
    const ivl_wide_t abs_s = ivl_wide_abs(s), abs_c = ivl_wide_abs(c);
    ivl_angle_t      a;
    a.swap = abs_s > abs_c;
    a.mirror = c < zero;
    a.negative = s < zero;
    const ivl_wide_t lo = ivl_wide_select(a.swap, abs_c, abs_s);
    const ivl_wide_t hi = ivl_wide_select(a.swap, abs_s, abs_c);
    a.turn = lo > 0.41421356237309504880 * hi;
    a.num = ivl_wide_select(a.turn, lo - hi, lo);
    const ivl_wide_t den = ivl_wide_select(a.turn, lo + hi, hi);
    a.den = ivl_wide_select(den > zero, den, ivl_wide(1.0));
    return a;
}

/// The angles, in [-pi, pi], given t = num / den of each.  The chains of several polynomials run side by side, since one
/// alone waits for each of its steps.
/// @param[in] n  number of angles, up to IVL_SIM_ANGLES_MAX
IVL_SIM_INLINE void ivl_wide_unfold(const ivl_angle_t *a, const ivl_wide_t *t, ivl_wide_t *angle, int n)
{
    ivl_wide_t u[IVL_SIM_ANGLES_MAX], p[IVL_SIM_ANGLES_MAX];
    IVL_SIM_UNROLL
    for (int i = 0; i < n; i++)
    {
        u[i] = t[i] * t[i];
        p[i] = ivl_wide(IVL_SIM_ATAN[10]);
    }
    IVL_SIM_UNROLL
    for (int k = 9; k >= 0; k--)
    {
        IVL_SIM_UNROLL
        for (int i = 0; i < n; i++)
        {
            p[i] = p[i] * u[i] + IVL_SIM_ATAN[k];
        }
    }
    IVL_SIM_UNROLL
    for (int i = 0; i < n; i++)
    {
        ivl_wide_t q = p[i] * t[i] + ivl_wide_select(a[i].turn, ivl_wide(0.25 * IVL_SIM_PI), ivl_wide(0.0));
        q = ivl_wide_select(a[i].swap, 0.5 * IVL_SIM_PI - q, q);
        q = ivl_wide_select(a[i].mirror, IVL_SIM_PI - q, q);
        angle[i] = ivl_wide_select(a[i].negative, -q, q);
    }
}

/// Angle of the point (c, s) from the first axis, in [-pi, pi].
IVL_SIM_INLINE ivl_wide_t ivl_wide_atan2(ivl_wide_t s, ivl_wide_t c)
{
    const ivl_angle_t a = ivl_wide_fold(s, c);
    const ivl_wide_t  t = a.num / a.den;
    ivl_wide_t        angle;
    ivl_wide_unfold(&a, &t, &angle, 1);
    return angle;
}

IVL_SIM_INLINE double ivl_sim_atan2(double s, double c)
{
    return ivl_wide_atan2(ivl_wide(s), ivl_wide(c))[0];
}

IVL_SIM_INLINE double ivl_sim_polynomial(const double *coefficient, int n, double x)
{
    double p = coefficient[n - 1];
    for (int k = n - 2; k >= 0; k--)
    {
        p = p * x + coefficient[k];
    }
    return p;
}

/// Sine and cosine for |x| <= 1e5.
IVL_SIM_INLINE void ivl_sim_sincos(double x, double *sine, double *cosine)
{
    // x = n pi/2 + r with pi/2 in two parts (Cody-Waite), the first with 30 significant bits so that n times it is exact
    const double  n = floor(x * (2.0 / IVL_SIM_PI) + 0.5);
    const double  r = (x - n * 1.57079632673412561417e+00) - n * 6.07710050650619224932e-11;
    const double  u = r * r;
    const double  s = r * ivl_sim_polynomial(IVL_SIM_SIN, 7, u);
    const double  c = ivl_sim_polynomial(IVL_SIM_COS, 8, u);
    const int64_t quadrant = (int64_t)n & 3;
    const double  a = (quadrant & 1) ? c : s, b = (quadrant & 1) ? s : c;
    *sine = (quadrant & 2) ? -a : a;
    *cosine = (quadrant == 1 || quadrant == 2) ? -b : b;
}

/// exp(x) for x <= 0; 0 below -700.
IVL_SIM_INLINE ivl_wide_t ivl_wide_exp(ivl_wide_t x)
{
    const ivl_wide_t n = ivl_wide_floor(x * 1.44269504088896340736 + 0.5);
    const ivl_wide_t r = (x - n * 6.93147180369123816490e-01) - n * 1.90821492927058770002e-10;
    // 2^n: the last digits of a number beyond 2^52 are whole, here the exponent of the power
    const ivl_wide_t power = (ivl_wide_t)((ivl_mask_t)(n + (4503599627370496.0 + 1023.0)) << 52);
    ivl_wide_t       p = ivl_wide(IVL_SIM_EXP[11]);
    IVL_SIM_UNROLL
    for (int k = 10; k >= 0; k--)
    {
        p = p * r + IVL_SIM_EXP[k];
    }
    return ivl_wide_select(x > -700.0, power * p, ivl_wide(0.0));
}

IVL_SIM_INLINE double ivl_sim_exp(double x)
{
    return ivl_wide_exp(ivl_wide(x))[0];
}

/// Natural logarithm of a positive, normal x.
IVL_SIM_INLINE double ivl_sim_log(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    double e = (double)(int64_t)(bits >> 52) - 1023.0;
    bits = (bits & 0x000fffffffffffffULL) | 0x3ff0000000000000ULL;
    double m;
    memcpy(&m, &bits, sizeof m);
    if (m > 1.41421356237309504880)
    {
        m *= 0.5;
        e += 1.0;
    }
    const double s = (m - 1.0) / (m + 1.0);
    return e * 0.69314718055994530942 + 2.0 * s * ivl_sim_polynomial(IVL_SIM_ATANH, 8, s * s);
}

#endif  // IVL_PHYS_MATH_H
