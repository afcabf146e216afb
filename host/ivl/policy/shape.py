"""What a form for every approach decides, as numbers over the sensed velocities; asked of the flight core itself.

The parameters of such a form are those of a threshold of RREV, then those that all of these forms share: the moment,
`go_p_min`, and the log-odds of a landing. Nothing here knows how a form computes its threshold.
"""

import numpy as np
import numpy.typing as npt

from ivl import forms, native
from ivl.errors import ConfigError
from ivl.forms import Form

FloatArray = npt.NDArray[np.float64]

MOMENT = ("m_0_Nmm", "m_x_Nmm", "m_z_Nmm")
GO_P_MIN = "go_p_min"
GO = ("go_0", "go_x", "go_z", "go_xx", "go_xz", "go_zz", "go_xxx", "go_xxz", "go_xzz", "go_zzz")
"""Coefficients of 1, x, z and their products, see `features`."""
THRESHOLD_PER_S_MIN, THRESHOLD_PER_S_MAX = 0.5, 20.0
_LEVEL_PER_S = 4.0
_SPEED_MPS_MIN = 0.05
_BISECTIONS = 40


class General:
    """A form with the parameters of every approach, and where they stand in theta."""

    def __init__(self, name: str) -> None:
        """Look the form up.

        Raises:
            ArgumentError: There is no form of that name.
            ConfigError: It is none for every approach.
        """
        self.form: Form = forms.by_name(name)
        shared = (*MOMENT, GO_P_MIN, *GO)
        self.n_threshold = self.form.n - len(shared)
        if self.n_threshold < 1 or self.form.names[self.n_threshold :] != shared:
            allowed = ", ".join(other for other in forms.forms() if is_general(other))
            raise ConfigError(f"form {name}: is not for every approach (allowed {allowed})")
        self.threshold = slice(0, self.n_threshold)
        self.moment = slice(self.n_threshold, self.n_threshold + len(MOMENT))
        self.searched = slice(0, self.moment.stop)
        self.go_p_min = self.moment.stop
        self.go = slice(self.go_p_min + 1, self.form.n)

    @property
    def bounds(self) -> FloatArray:
        """What a vehicle accepts of each parameter, shape (n, 2), in the units of the form."""
        return np.array([(p.lo, p.hi) for p in self.form.params])

    def level(self, threshold_per_s: npt.ArrayLike, moment_Nmm: npt.ArrayLike) -> FloatArray:
        """Policies with the same threshold and moment at every approach, always go; shape (..., n).

        A parameter whose range has no zero is a threshold itself; of the others the first is the constant one.
        """
        r, m = np.broadcast_arrays(
            np.asarray(threshold_per_s, dtype=np.float64), np.asarray(moment_Nmm, dtype=np.float64)
        )
        theta = np.zeros((*r.shape, self.form.n))
        own = [p.lo > 0 for p in self.form.params[self.threshold]]
        columns = np.flatnonzero(own) if any(own) else np.array([0])
        theta[..., columns] = r[..., None]
        theta[..., self.moment.start] = m
        return theta

    def always_go(self, theta: npt.ArrayLike) -> FloatArray:
        """The same policies, which refuse no approach."""
        free = np.array(theta, dtype=np.float64)
        free[..., self.go_p_min] = 0.0
        return free

    def telling(self, theta: npt.ArrayLike, axis: int) -> FloatArray:
        """The same policy, always go, whose estimate tells a coordinate of the point of decision: 0 for x, 1 for z."""
        told = self.always_go(theta)
        told[..., self.go] = 0.0
        told[..., self.go.start + 1 + axis] = 1.0
        return told

    def thresholds(self, theta: npt.ArrayLike, vx_mps: npt.ArrayLike, vz_mps: npt.ArrayLike) -> FloatArray:
        """R*(vx, vz) in 1/s, found by asking the core where it begins to flip; shape of the velocities."""
        vx, vz = np.broadcast_arrays(np.asarray(vx_mps, dtype=np.float64), np.asarray(vz_mps, dtype=np.float64))
        low = np.full(vx.shape, THRESHOLD_PER_S_MIN * 0.5)
        high = np.full(vx.shape, THRESHOLD_PER_S_MAX * 1.01)
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            flips = self._decide(theta, vx, vz, middle)[..., 0] > 0.5
            low, high = np.where(flips, low, middle), np.where(flips, middle, high)
        return high

    def moments(self, theta: npt.ArrayLike, vx_mps: npt.ArrayLike, vz_mps: npt.ArrayLike) -> FloatArray:
        """Moment of the flip in N mm."""
        return 1e3 * self._decide(theta, vx_mps, vz_mps, _LEVEL_PER_S)[..., 2]

    def probabilities(self, theta: npt.ArrayLike, vx_mps: npt.ArrayLike, vz_mps: npt.ArrayLike) -> FloatArray:
        """Probability of a landing, as the core estimates it."""
        return self._decide(theta, vx_mps, vz_mps, _LEVEL_PER_S)[..., 3]

    def _decide(
        self, theta: npt.ArrayLike, vx_mps: npt.ArrayLike, vz_mps: npt.ArrayLike, rrev_per_s: npt.ArrayLike
    ) -> FloatArray:
        """What the core decides when it senses these velocities at this RREV, shape (..., 4)."""
        vx, vz, rrev = np.broadcast_arrays(*(np.asarray(a, dtype=np.float64) for a in (vx_mps, vz_mps, rrev_per_s)))
        d_m = np.maximum(vz, _SPEED_MPS_MIN) / rrev
        seen = np.stack([d_m, rrev, -vx / d_m], axis=-1)
        actions = native.library().decide(self.form.number, self.form.to_si(theta), seen.reshape(-1, 3))
        return actions.reshape(*vx.shape, 4)


def is_general(name: str) -> bool:
    """Whether a form has the parameters of the forms for every approach."""
    return forms.by_name(name).names[-len(GO) - 1 - len(MOMENT) :] == (*MOMENT, GO_P_MIN, *GO)


def features(x: npt.ArrayLike, z: npt.ArrayLike) -> FloatArray:
    """What the coefficients `GO` multiply, shape (..., 10), of a point of decision in the core's coordinates."""
    x, z = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(z, dtype=np.float64))
    return np.stack([np.ones_like(x), x, z, x * x, x * z, z * z, x**3, x * x * z, x * z * z, z**3], axis=-1)
