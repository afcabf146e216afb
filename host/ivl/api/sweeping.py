"""`ivl.sweep`: a grid of approaches, gears and whatever else is varied, on all processors."""

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ivl import plugins, references
from ivl.api.learning import LearnerLike, RewardLike, plain, set_choices
from ivl.api.runs import MapRun, SweepRun
from ivl.errors import ConfigError
from ivl.optional import needed

if TYPE_CHECKING:
    from ivl.sweep.config import PolicyMap, Sweep

_EXTRA = "sweep"


def sweep(
    what: "str | PathLike[str] | Sweep | PolicyMap" = "smoke",
    *,
    vary: Mapping[str, Sequence[Any]] | None = None,
    learner: LearnerLike | None = None,
    reward: RewardLike | None = None,
    out: str | PathLike[str] | None = None,
    resume: bool = False,
    workers: int | None = None,
    scheduler: str | None = None,
    **options: Any,
) -> SweepRun | MapRun:
    """Learn over a grid, or fly a policy map; what `ivl sweep` and `ivl map` do.

        ivl.sweep("smoke", vary={"sense.latency": [0.0, 0.02]}, trials=2, workers=2).trials()

    Workers are processes. A program that calls this must do so under `if __name__ == "__main__":`, and learners and
    rewards of your own must be in a module that can be imported, not in the notebook itself.

    Args:
        what: Name of a shipped file (`ivl list sweeps`), path of a file, a sweep, or a map.
        vary: Values by dotted path, in place of what the file says of that path.
        learner: As for `ivl.learn`.
        reward: As for `ivl.learn`.
        out: Run folder; omitted: a new one under `runs/`.
        resume: Continue the run in `out`.
        workers: Worker processes; omitted: one for each processor.
        scheduler: Address of a Dask scheduler; omitted: processes of this machine.
        **options: Fields of the file and dotted paths, as for `ivl.learn`.

    Raises:
        ConfigError: A name, path or value is wrong; the message says what is allowed.
        MissingError: The packages of the extra `sweep` are not installed.
        StoreError: The run folder cannot be used.
    """
    for package in ("pyarrow", "xarray", "distributed"):
        needed(package, _EXTRA)
    from ivl import run as runs
    from ivl.sweep import config, engine

    data, label = _raw(what)
    set_choices(data, learner, reward)
    for field in ("learner", "reward"):
        plugins.refuse_main(field, (data.get(field) or {}).get("name"))
    values = {path: plain(value) for path, value in options.items()}
    varied = {path: plain(each) for path, each in (vary or {}).items()}
    grid = config.from_data(data, label, values, varied)
    base = f"{grid.name}-{references.title(grid.gear_set)}"
    if isinstance(grid, config.Sweep):
        base += f"-{'-'.join(map(plugins.title, grid.learner_names()))}"
    if resume and out is None:
        raise ConfigError("resume: needs the run folder: out=...")
    folder = runs.numbered_folder(base, resume) if out is None else Path(out)
    engine.run(grid, folder, resume=resume, scheduler=scheduler, workers=workers)
    return SweepRun(folder) if isinstance(grid, config.Sweep) else MapRun(folder)


def _raw(what: Any) -> tuple[dict[str, Any], str]:
    """Raw data of a sweep or a map, and what errors call it."""
    from ivl.sweep import config

    if isinstance(what, (config.Sweep, config.PolicyMap)):
        return what.model_dump(), what.name
    if not isinstance(what, (str, PathLike)):
        raise ConfigError(f"{type(what).__name__} is nothing to sweep: give a name, a path, a Sweep or a PolicyMap")
    return config.read(str(what))
