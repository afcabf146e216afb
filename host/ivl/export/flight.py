"""One landing as time series, wherever it comes from: the simulator, a trace file, or a vehicle's flight recorder."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ivl import outcome, tracefile
from ivl.flight import table as border
from ivl.landing import LandingSpec
from ivl.rewards import RewardChoice
from ivl.world import World, rotation

FloatArray = npt.NDArray[np.float64]

_RECORDER = {
    "p_WB_m": ("p_x_W_m", "p_y_W_m", "p_z_W_m"),
    "v_WB_mps": ("v_x_W_mps", "v_y_W_mps", "v_z_W_mps"),
    "q_WB": ("q_WB_x", "q_WB_y", "q_WB_z", "q_WB_w"),
    "w_B_radps": ("w_x_B_radps", "w_y_B_radps", "w_z_B_radps"),
    "f_B_mps2": ("f_x_B_mps2", "f_y_B_mps2", "f_z_B_mps2"),
    "thrust_cmd_N": ("thrust1_N", "thrust2_N", "thrust3_N", "thrust4_N"),
    "d_sensed_m": ("d_ceil_m",),
    "phase": ("phase",),
    "rule": ("rule",),
}
"""Where a flight recorder's table (`Recording.to_csv`) has what a trace has, under the trace's names."""


@dataclass(frozen=True)
class Flight:
    """A landing to export.

    Attributes:
        title: What it is, in a line.
        columns: Every number by name with its unit, each of shape (n,); the names are those of `ivl rollout --trace`.
        phase: Name of the phase in each row.
        world: Shapes of the vehicle, and the surface.
        facts: What else is known, as text: specification, outcome.
    """

    title: str
    columns: dict[str, npt.NDArray[Any]]
    phase: list[str]
    world: World
    facts: dict[str, str] = field(default_factory=dict)

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.phase)

    @property
    def t_s(self) -> FloatArray:
        """Time of each row, s, increasing."""
        return np.asarray(self.columns["t_s"], dtype=np.float64)

    def vector(self, name: str, count: int) -> FloatArray:
        """The components `name_1` .. `name_count` as one array of shape (n, count)."""
        return np.column_stack([self.columns[f"{name}_{i + 1}"] for i in range(count)]).astype(np.float64)

    @property
    def feet_W_m(self) -> FloatArray | None:
        """Feet in the world, shape (n, 4, 3); None if they were not recorded."""
        return self.vector("foot_W_m", 12).reshape(-1, 4, 3) if "foot_W_m_1" in self.columns else None

    @property
    def feet_stuck(self) -> npt.NDArray[np.bool_]:
        """Which feet are stuck, shape (n, 4)."""
        return np.asarray(self.vector("foot_state", 4) == 2)

    def hips_W_m(self) -> FloatArray:
        """Where the legs begin, shape (n, 4, 3)."""
        values = self.world.params.values
        xy, z = values["leg.hip_xy"], values["leg.hip_z"]
        hips_B = np.array([[xy, -xy, z], [-xy, -xy, z], [-xy, xy, z], [xy, xy, z]])
        turned = np.einsum("ijn,lj->nli", rotation(self.vector("q_WB", 4).T), hips_B)
        return np.asarray(turned + self.vector("p_WB_m", 3)[:, None, :])


def of_spec(spec: LandingSpec, title: str, reward: RewardChoice | None = None) -> Flight:
    """Fly a landing; `reward` is what its run paid for landings, if it comes from one."""
    world, trace = spec.fly()
    result = outcome.as_dict(trace.outcome, world.end_reason(trace.outcome.end_reason))
    said = {**spec.model_dump(mode="json", exclude={"theta"}), **spec.policy}
    facts = {f"spec.{name}": str(value) for name, value in said.items()}
    facts |= {f"outcome.{name}": str(value) for name, value in result.items()}
    if reward:
        terms = reward.score(np.array([trace.outcome], dtype=trace.outcome.dtype))
        facts |= {f"reward.{name}": str(float(value[0])) for name, value in terms.items()}
    return of_rows(trace.rows, world, title, facts)


def of_file(path: Path, world: World) -> Flight:
    """Read a trace (`ivl rollout --trace`) or the table of a flight recorder.

    Args:
        path: A .csv or .npz file.
        world: Whose shapes to draw; the file does not tell.

    Raises:
        ConfigError: The file is neither.
    """
    tracefile.check_suffix(path)
    table = tracefile.read_table(path)
    if "p_x_W_m" in table.columns:
        return _of_recorder(table, path, world)
    return of_rows(tracefile.rows_of(table), world, path.name, {"file": path.name})


def of_rows(rows: Any, world: World, title: str, facts: dict[str, str]) -> Flight:
    """The rows of a trace."""
    return Flight(title, tracefile.columns(rows), [world.phase_name(int(code)) for code in rows["phase"]], world, facts)


def _of_recorder(table: border.Table, path: Path, world: World) -> Flight:
    """Recorder rows under the trace's names; the cues follow from distance and velocity as the core computes them."""
    sources_all = ("t_s", *(source for sources in _RECORDER.values() for source in sources))
    table.need(sources_all, "the table of a flight recorder")
    columns: dict[str, npt.NDArray[Any]] = {"t_s": border.clock(table, "t_s", 1.0)}
    for name, sources in _RECORDER.items():
        for i, source in enumerate(sources):
            columns[name if len(sources) == 1 else f"{name}_{i + 1}"] = table.numbers(source, needed=True)
    d_m = np.where(columns["d_sensed_m"] > 0, columns["d_sensed_m"], np.nan)
    columns["rrev_per_s"] = columns["v_WB_mps_3"] / d_m
    columns["of_y_radps"] = -columns["v_WB_mps_1"] / d_m
    columns["pitch_deg"] = nose_up_deg(np.column_stack([columns[f"q_WB_{i}"] for i in (1, 2, 3, 4)]))
    phase = [world.phase_name(int(code)) for code in columns["phase"]]
    return Flight(path.name, columns, phase, world, {"file": path.name, "source": "flight recorder"})


def nose_up_deg(q: FloatArray) -> FloatArray:
    """Rotation about b_y, nose up, unwrapped: the direction of b_x in the x-z plane of the world."""
    matrix = rotation(q.T)
    return np.asarray(np.rad2deg(np.unwrap(np.arctan2(matrix[2, 0], matrix[0, 0]))))
