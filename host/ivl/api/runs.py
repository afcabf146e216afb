"""`ivl.load`: a run folder as data frames, whoever wrote it and whether it is finished."""

from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ivl import native
from ivl.errors import ConfigError
from ivl.experiment import Experiment
from ivl.optional import needed
from ivl.store import RunStore, read_manifest
from ivl.table import Rollouts
from ivl.world import Trace, World

if TYPE_CHECKING:
    import pandas as pd  # type: ignore[import-untyped]
    import xarray as xr

    from ivl.landing import LandingSpec
    from ivl.sweep.config import PolicyMap, Sweep

_EXTRA_REPORT, _EXTRA_SWEEP = "report", "sweep"


class LearnRun:
    """A run of `ivl learn`. It may still be going on: what is finished is read at each call.

    Data frames have units and meanings of their columns in `frame.attrs["units"]` and `frame.attrs["docs"]`. Their
    columns are called as those of a sweep (`ivl.sweep.schema`), so that frames of both can be put together.

    Attributes:
        folder: The run folder.
        experiment: What was run, as it was resolved.
        n_trials: How many seeds were learned together; None: one, with a summary of its own.
    """

    def __init__(self, folder: str | PathLike[str]) -> None:
        """Read what was run (errors as `load`)."""
        from ivl import run  # loads all that can judge

        self.folder = Path(folder)
        self.experiment: Experiment
        self.experiment, self.n_trials = run.read_config(self.folder)

    @property
    def manifest(self) -> dict[str, Any]:
        """What identifies the run, namely versions, digests, seeds, parameters."""
        return read_manifest(self.folder)

    @property
    def result(self) -> dict[str, Any] | None:
        """The summary that `ivl learn --json` prints, with a verdict for each trial; None: the run is not finished."""
        from ivl.api import frames

        return frames.read_result(self.folder)

    def rollouts(self) -> "pd.DataFrame":
        """One row for each rollout that was planned: policy, return and its terms, outcome; NaN where not flown."""
        from ivl.api import frames

        with self._store() as store:
            return frames.rollouts(self.experiment, store.layout, store.rollouts())

    def episodes(self) -> "pd.DataFrame":
        """One row for each finished episode of each trial: where the search stood, returns, landing rates."""
        from ivl.api import frames

        with self._store() as store:
            return frames.episodes(self.experiment, store.layout, store.episodes())

    def trials(self) -> "pd.DataFrame":
        """One row for each trial: what it found, and how good that is; the judgement is missing until it is made."""
        from ivl.api import frames

        with self._store() as store:
            return frames.trials(self.experiment, store.layout, store.episodes(), store.rollouts(), self.result)

    def outcomes(self) -> Rollouts:
        """Outcomes of all scored rollouts, as `World.rollouts` gives them, in the order of `rollouts()`."""
        from ivl.learning.recorder import SCORED

        with self._store() as store:
            rows = store.rollouts()
        found: Rollouts = rows.outcomes[rows.status == SCORED].view(Rollouts)
        return found

    def world(self, trial: int = 0) -> World:
        """The world that a trial flew in."""
        return self.experiment.trial(trial).make_world()

    def recommended(self, trial: int = 0) -> dict[str, float]:
        """The policy that the learner of a trial recommends, by the names of its parameters.

        Raises:
            ConfigError: The trial has no finished episode.
        """
        with self._store() as store:
            own = [row for row in store.episodes() if row.trial == trial]
        if not own:
            raise ConfigError(f"{self.folder}: trial {trial} has no finished episode")
        return dict(zip(self.experiment.policy.shape.names, own[-1].recommended, strict=True))

    def landing(self, policy: dict[str, float] | None = None, trial: int = 0, stream: int = 0) -> "LandingSpec":
        """The specification of one landing of what was learned.

        Args:
            policy: The policy; omitted: the one that is recommended.
            trial: Trial whose vehicle and random numbers fly.
            stream: Number of the rollout; those of the run are 0, 1 ... in the order in which they were flown.
        """
        from ivl import landing

        chosen = policy or self.recommended(trial)
        theta = [chosen[name] for name in self.experiment.policy.shape.names]
        return landing.of_rollout(self.experiment, trial, theta, stream)

    def fly(self, policy: dict[str, float] | None = None, trial: int = 0, stream: int = 0) -> Trace:
        """Fly one landing of what was learned, and record it (arguments as `landing`)."""
        return self.landing(policy, trial, stream).fly()[1]

    def report(self, out: str | PathLike[str] | None = None) -> Path:
        """Write the page of the run, and return its path; `out` omitted: `report.html` in the run folder."""
        return _report(self.folder, out)

    def __repr__(self) -> str:
        """What was run, and how it went."""
        name = f"{self.experiment.name} with {self.experiment.learner.name}"
        result = self.result
        if result is None:
            return f"<run of {name} in {self.folder}: not finished; continue it with ivl.learn(..., resume=True)>"
        verdicts = result["verdicts"]
        solved = sum(verdict["solved"] for verdict in verdicts)
        return f"<run of {name} in {self.folder}: solved {solved} of {len(verdicts)}>"

    def _store(self) -> RunStore:
        return RunStore.open_reading(self.folder, native.library().outcome_dtype)


class _GridRun:
    """A run whose tables are Parquet."""

    def __init__(self, folder: str | PathLike[str]) -> None:
        """Read what was run (errors as `load`)."""
        needed("pyarrow", _EXTRA_SWEEP)
        from ivl.sweep import store

        self.folder = Path(folder)
        self.manifest: dict[str, Any] = store.read_manifest(self.folder)

    def failures(self) -> "pd.DataFrame":
        """One row for each trial that could not be finished, with its error."""
        return self._frame("failures")

    def _frame(self, kind: str) -> "pd.DataFrame":
        from ivl.columns import codes
        from ivl.sweep import schema, store

        frame = store.read_frame(self.folder, kind)
        table = store.read_table(self.folder, kind).schema
        frame.attrs["docs"] = {column.name: column.metadata[b"doc"].decode() for column in table}
        for name, names in codes().items():
            if name in frame and kind == schema.ROLLOUTS:
                frame[name] = frame[name].map(names).astype("category")
        return frame


class SweepRun(_GridRun):
    """A run of `ivl sweep`; its data frames are as those of `LearnRun`.

    Attributes:
        folder: The run folder.
        manifest: What identifies the run.
    """

    @cached_property
    def sweep(self) -> "Sweep":
        """What was run, as it was resolved."""
        from ivl import yamlfile
        from ivl.sweep.config import Sweep

        return yamlfile.validate(Sweep, self.manifest["sweep"], str(self.folder))

    def rollouts(self) -> "pd.DataFrame":
        """One row for each rollout; no rows unless the sweep has `keep_rollouts: true`."""
        return self._frame("rollouts")

    def episodes(self) -> "pd.DataFrame":
        """One row for each episode of each trial."""
        return self._frame("episodes")

    def trials(self) -> "pd.DataFrame":
        """One row for each trial."""
        return self._frame("trials")

    def to_xarray(self, kind: str = "trials") -> "xr.Dataset":
        """A table as a labelled array over gear, speed, angle and whatever else was varied."""
        from ivl.sweep import store

        return store.to_xarray(self.folder, kind)

    def report(self, out: str | PathLike[str] | None = None) -> Path:
        """Write the page of the run, and return its path; `out` omitted: `report.html` in the run folder."""
        return _report(self.folder, out)

    def __repr__(self) -> str:
        """What was run, and how much of it is there."""
        trials = self.trials()
        failed = len(self.failures())
        rate = trials["landing_rate_four_leg_norm"].mean()
        words = f"{len(trials)} trials, landing rate {100 * rate:.1f} %" if len(trials) else "no trial yet"
        return f"<sweep {self.sweep.name} in {self.folder}: {words}{f', {failed} failed' if failed else ''}>"


class MapRun(_GridRun):
    """A run of `ivl map`: flips commanded at once over a grid, without learning."""

    @cached_property
    def map(self) -> "PolicyMap":
        """What was run, as it was resolved."""
        from ivl import yamlfile
        from ivl.sweep.config import PolicyMap

        return yamlfile.validate(PolicyMap, self.manifest["map"], str(self.folder))

    def points(self) -> "pd.DataFrame":
        """One row for each point of the map."""
        return self._frame("map")

    def to_xarray(self) -> "xr.Dataset":
        """The map as a labelled array over gear, speed, angle, distance and moment."""
        from ivl.sweep import store

        return store.to_xarray(self.folder, "map")

    def __repr__(self) -> str:
        """What was run."""
        return f"<map {self.map.name} in {self.folder}: {len(self.points())} points>"


def load(folder: str | PathLike[str]) -> LearnRun | SweepRun | MapRun:
    """Read a run folder of `ivl learn`, `ivl sweep` or `ivl map`.

        run = ivl.load("runs/mine")
        run.trials(), run.episodes(), run.rollouts()

    Raises:
        StoreError: The folder holds no run, or one of another version.
        ConfigError: Its configuration names a learner or a reward that cannot be imported here, or is damaged.
        MissingError: pandas, or for a sweep pyarrow, is not installed.
    """
    manifest = read_manifest(Path(folder))
    if "map" in manifest:
        return MapRun(folder)
    return SweepRun(folder) if "sweep" in manifest else LearnRun(folder)


def _report(folder: Path, out: str | PathLike[str] | None) -> Path:
    for package in ("plotly", "pandas"):
        needed(package, _EXTRA_REPORT)
    from ivl import report

    return report.write(folder, None if out is None else Path(out)).path
