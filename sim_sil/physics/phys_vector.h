/// @file phys_vector.h
/// Numbers, vectors and rotations of one vehicle.  Double precision, SI, radians.  Pure, no state.
#ifndef IVL_PHYS_VECTOR_H
#define IVL_PHYS_VECTOR_H

#include <stdbool.h>

#define IVL_SIM_INLINE static inline __attribute__((always_inline))

IVL_SIM_INLINE double ivl_sim_smaller(double a, double b)
{
    return (a < b) ? a : b;
}

IVL_SIM_INLINE double ivl_sim_larger(double a, double b)
{
    return (a > b) ? a : b;
}

typedef struct
{
    double x, y, z;
} ivl_d3_t;

IVL_SIM_INLINE ivl_d3_t ivl_d3(double x, double y, double z)
{
    return (ivl_d3_t){x, y, z};
}

IVL_SIM_INLINE ivl_d3_t ivl_d3_load(const double a[3])
{
    return (ivl_d3_t){a[0], a[1], a[2]};
}

IVL_SIM_INLINE void ivl_d3_store(double a[3], ivl_d3_t v)
{
    a[0] = v.x;
    a[1] = v.y;
    a[2] = v.z;
}

IVL_SIM_INLINE ivl_d3_t ivl_d3_add(ivl_d3_t a, ivl_d3_t b)
{
    return (ivl_d3_t){a.x + b.x, a.y + b.y, a.z + b.z};
}

IVL_SIM_INLINE ivl_d3_t ivl_d3_sub(ivl_d3_t a, ivl_d3_t b)
{
    return (ivl_d3_t){a.x - b.x, a.y - b.y, a.z - b.z};
}

IVL_SIM_INLINE ivl_d3_t ivl_d3_scale(double s, ivl_d3_t a)
{
    return (ivl_d3_t){s * a.x, s * a.y, s * a.z};
}

/// True if the unit vector a is z, to within rounding.
IVL_SIM_INLINE bool ivl_d3_is_z(ivl_d3_t a)
{
    return a.z >= 1.0;
}

/// Part of b along the unit vector a.  For z the products with 0 and 1 are left out: they would change no number.
IVL_SIM_INLINE double ivl_d3_along(ivl_d3_t a, ivl_d3_t b)
{
    return ivl_d3_is_z(a) ? b.z : a.x * b.x + a.y * b.y + a.z * b.z;
}

IVL_SIM_INLINE double ivl_d3_dot(ivl_d3_t a, ivl_d3_t b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

IVL_SIM_INLINE ivl_d3_t ivl_d3_cross(ivl_d3_t a, ivl_d3_t b)
{
    return (ivl_d3_t){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/// Rotation matrix body to world, by rows: `row[2]` holds the world z components of the body axes.
typedef struct
{
    ivl_d3_t row[3];
} ivl_rot_t;

/// R_WB of a quaternion x, y, z, w that need not be normalised exactly (the stages of a Runge-Kutta step are not).
IVL_SIM_INLINE ivl_rot_t ivl_rot_from_quat(const double q[4])
{
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    const double s = 2.0 / (x * x + y * y + z * z + w * w);
    const double xs = x * s, ys = y * s, zs = z * s;
    ivl_rot_t    R;
    R.row[0] = ivl_d3(1.0 - (y * ys + z * zs), x * ys - w * zs, x * zs + w * ys);
    R.row[1] = ivl_d3(x * ys + w * zs, 1.0 - (x * xs + z * zs), y * zs - w * xs);
    R.row[2] = ivl_d3(x * zs - w * ys, y * zs + w * xs, 1.0 - (x * xs + y * ys));
    return R;
}

IVL_SIM_INLINE ivl_d3_t ivl_rot_apply(const ivl_rot_t *R, ivl_d3_t a)
{
    return ivl_d3(ivl_d3_dot(R->row[0], a), ivl_d3_dot(R->row[1], a), ivl_d3_dot(R->row[2], a));
}

IVL_SIM_INLINE ivl_d3_t ivl_rot_apply_inverse(const ivl_rot_t *R, ivl_d3_t a)
{
    return ivl_d3_add(ivl_d3_add(ivl_d3_scale(a.x, R->row[0]), ivl_d3_scale(a.y, R->row[1])), ivl_d3_scale(a.z, R->row[2]));
}

#endif  // IVL_PHYS_VECTOR_H
