"""How wrong the estimator is: approaches to several surfaces, rendered, estimated, and compared with the truth."""

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from ivl.camera import motion, native, textures

RREV_RANGE = (2.0, 6.0)  # readings that are judged, 1/s
OUTLIER_NORM = 0.25
ANGLES_DEG = (30.0, 90.0)
SPEEDS_MPS = (1.5, 3.5)


@dataclass(frozen=True)
class Case:
    """A row of the table.

    Attributes:
        name: What is different.
        texture: Surface.
        camera: Numbers of the camera that are not the library's defaults.
        angles_deg: Approaches are drawn between these.
        limits: What the row must show, by the name of a figure; a limit of `valid` is the least of `seen` or the most.
        against: Row whose standard deviation this one is compared with.
    """

    name: str
    texture: str
    camera: dict[str, float] = field(default_factory=dict)
    angles_deg: tuple[float, float] = ANGLES_DEG
    limits: dict[str, float] = field(default_factory=dict)
    against: str = ""


_TEXTURED = {"bias": 0.01, "sigma": 0.015, "of_y": 0.05}
_PANELS = {"bias": 0.01, "sigma": 0.04, "outliers": 0.02, "of_y": 0.05}
_FLICKER = {"exposure": 0.004, "flicker": 0.3}

CASES = (
    Case("noise", "noise", limits=_TEXTURED),
    Case("dots", "dots", limits=_TEXTURED),
    Case("low contrast", "low_contrast", limits=_TEXTURED),
    Case("checks", "checks"),
    Case("panels", "panels", limits=_PANELS),
    Case("30 degrees", "noise", angles_deg=(30.0, 30.0), limits={"bias": 0.02}),
    Case("45 degrees", "noise", angles_deg=(45.0, 45.0), limits={"bias": 0.02}),
    Case("90 degrees", "noise", angles_deg=(90.0, 90.0), limits={"bias": 0.02}),
    Case("white wall", "white", limits={"invalid": 0.99}),
    Case("lines", "lines", limits={"invalid": 0.99}),
    Case("flicker 100 Hz", "noise", {**_FLICKER, "flicker_rate": 100.0}, limits={"ratio": 1.2}, against="noise"),
    Case("flicker 120 Hz", "noise", {**_FLICKER, "flicker_rate": 120.0}, limits={"ratio": 1.2}, against="noise"),
    Case("panels 100 Hz", "panels", {**_FLICKER, "flicker_rate": 100.0}, limits={"ratio": 1.2}, against="panels"),
    Case("panels 120 Hz", "panels", {**_FLICKER, "flicker_rate": 120.0}, limits={"ratio": 1.2}, against="panels"),
    Case("exposure 10 ms", "noise", {"exposure": 0.01}),
    Case("distortion", "noise", {"radial_1": -0.15, "radial_2": 0.02}),
    Case("320 x 240", "noise", {"width": 320.0, "focal": 181.0, "row_time": 3.2e-5}),
    Case("board 0.8 m", "noise", {"board_x": 0.8, "board_y": 0.8}, angles_deg=(90.0, 90.0)),
    Case("camera tilted 30 mrad", "noise", {"mount_pitch": 0.03}),
)


@dataclass(frozen=True)
class Figures:
    """A row of the table in numbers; of readings whose true RREV is within `RREV_RANGE`.

    Attributes:
        n: Readings, valid or not.
        valid: Share that is valid.
        bias: Mean error of RREV over RREV.
        sigma: Standard deviation of it.
        outliers: Share of the valid ones that is off by more than 25 %.
        of_y: Root of the mean square of OF_y's error, rad/s.
        within: Share within two standard deviations that the estimator declared.
        ratio: `sigma` over that of another row; 0 without one.
        failed: Figures beyond their limits.
    """

    name: str
    n: int
    valid: float
    bias: float
    sigma: float
    outliers: float
    of_y: float
    within: float
    ratio: float
    failed: tuple[str, ...]

    @property
    def invalid(self) -> float:
        """Share that is not valid."""
        return 1.0 - self.valid


def _one(case: Case, seed: int, index: int) -> npt.NDArray[np.float64]:
    """Readings of one approach: true RREV, valid, RREV, its sigma, error of OF_y."""
    rng = np.random.default_rng([seed, index])
    angle, speed = np.deg2rad(rng.uniform(*case.angles_deg)), rng.uniform(*SPEEDS_MPS)
    flown = motion.fly(motion.Approach(float(speed), float(angle)), rng)
    if "board_x" in case.camera:  # the board is where the vehicle comes to
        flown.rows[:, 1:3] -= flown.rows[-1, 1:3]
    seen = native.look(native.Camera(**case.camera), textures.make(case.texture), flown.rows, seed=seed, stream=index)
    rrev, _, of_y = flown.truth(seen.readings["t"] * 1.0e-6)
    return np.column_stack(
        [rrev, seen.valid, seen.number("rrev"), seen.number("sigma_rrev"), seen.number("of_y") - of_y]
    )


def readings(case: Case, n_approaches: int, seed: int = 0) -> npt.NDArray[np.float64]:
    """All readings of a case within `RREV_RANGE`, the same whatever the number of threads."""
    textures.make(case.texture)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        rows = np.concatenate(list(pool.map(lambda i: _one(case, seed, i), range(n_approaches))))
    return rows[(rows[:, 0] >= RREV_RANGE[0]) & (rows[:, 0] <= RREV_RANGE[1])]


def figures(case: Case, rows: npt.NDArray[np.float64], other_sigma: float = 0.0) -> Figures:
    """A row of the table from its readings."""
    valid = rows[rows[:, 1] > 0]
    error = valid[:, 2] / valid[:, 0] - 1.0
    some = len(valid) > 0
    values = {
        "bias": float(error.mean()) if some else 0.0,
        "sigma": float(error.std()) if some else 0.0,
        "outliers": float((np.abs(error) > OUTLIER_NORM).mean()) if some else 0.0,
        "of_y": float(np.sqrt((valid[:, 4] ** 2).mean())) if some else 0.0,
        "within": float((np.abs(valid[:, 2] - valid[:, 0]) <= 2.0 * valid[:, 3]).mean()) if some else 0.0,
        "valid": len(valid) / len(rows),
    }
    values["ratio"] = values["sigma"] / other_sigma if other_sigma > 0.0 else 0.0
    shown = {**values, "invalid": 1.0 - values["valid"]}
    failed = [
        name
        for name, limit in case.limits.items()
        if (shown[name] < limit if name == "invalid" else abs(shown[name]) > limit)
    ]
    if "sigma" in case.limits and not 0.90 <= values["within"] <= 0.99:
        failed.append("within")
    return Figures(case.name, len(rows), failed=tuple(failed), **values)


def table(n_approaches: int, seed: int = 0, cases: tuple[Case, ...] = CASES) -> list[Figures]:
    """All rows, in the order of the cases."""
    done: dict[str, Figures] = {}
    for case in cases:
        other = done[case.against].sigma if case.against else 0.0
        done[case.name] = figures(case, readings(case, n_approaches, seed), other)
    return list(done.values())
