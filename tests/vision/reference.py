"""The fit in floating point, written anew from its equations, and iterated until nothing moves."""

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
FOCAL, CENTRE = 45.25, (39.5, 29.5)
WINDOW = (56, 42)


def binned(raw: npt.NDArray[np.uint8]) -> Array:
    """Means of 2 x 2 pixels."""
    return np.asarray(raw.astype(np.float64).reshape(60, 2, 80, 2).mean(axis=(1, 3)))


def rotation(q: Array) -> Array:
    """Matrix of a quaternion x y z w."""
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _sample(image: Array, x: Array, y: Array) -> Array:
    inside = (x >= 0) & (x < 79) & (y >= 0) & (y < 59)
    x0, y0 = np.clip(x.astype(int), 0, 78), np.clip(y.astype(int), 0, 58)
    fx, fy = x - x0, y - y0
    above = image[y0, x0] * (1 - fx) + image[y0, x0 + 1] * fx
    below = image[y0 + 1, x0] * (1 - fx) + image[y0 + 1, x0 + 1] * fx
    return np.where(inside, above * (1 - fy) + below * fy, np.nan)


def fit(now: Array, then: Array, turn: Array, normal: Array, passes: int = 8) -> Array:
    """Displacement over the present distance, of which `normal` @ it is the closing; starts from no motion at all."""
    width, height = WINDOW
    x, y = np.meshgrid(np.arange(width + 2) + 39 - width // 2, np.arange(height + 2) + 29 - height // 2)
    m = np.stack([(x - CENTRE[0]) / FOCAL, (y - CENTRE[1]) / FOCAL, np.ones(x.shape)])
    facing = np.tensordot(normal, m, 1)
    rows = np.polynomial.legendre.legvander(np.linspace(-1, 1, height + 2), 3)[:, 1:]
    p, gain, offset = np.zeros(3), np.ones(height + 2), 0.0
    inner = (slice(1, -1), slice(1, -1))
    for _ in range(passes):
        seen = np.tensordot(turn @ (np.eye(3) + np.outer(p, normal)), m, 1)
        warped = _sample(then, CENTRE[0] + FOCAL * seen[0] / seen[2], CENTRE[1] + FOCAL * seen[1] / seen[2])
        warped = warped * gain[:, None] + offset
        mean = 0.5 * (warped + now[y, x])
        gx, gy = 0.5 * (mean[1:-1, 2:] - mean[1:-1, :-2]), 0.5 * (mean[2:, 1:-1] - mean[:-2, 1:-1])
        s, u, v = facing[inner], m[0][inner], m[1][inner]
        grey = warped[inner]
        terms = [np.ones(grey.shape), grey, *(grey * rows[1:-1, j : j + 1] for j in range(3))]
        terms += [FOCAL * s * gx, FOCAL * s * gy, -FOCAL * s * (u * gx + v * gy)]
        a = np.stack([term.ravel() for term in terms], axis=1)
        r = (now[y, x][inner] - grey).ravel()
        good = np.isfinite(a).all(axis=1) & np.isfinite(r)
        solution = np.linalg.lstsq(a[good], r[good], rcond=None)[0]
        p = p + solution[5:] + p * (normal @ solution[5:])
        gain = gain * (1 + solution[1] + rows @ solution[2:5])
        offset += solution[0]
    return p
