"""`ivl.learn`: from a file, an experiment or a task to a run that can be read."""

from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ivl import experiment, plugins
from ivl.api.runs import LearnRun
from ivl.errors import ConfigError
from ivl.experiment import Experiment
from ivl.learners import LEARNERS, Learner
from ivl.rewards import REWARDS, Reward
from ivl.settings import apply_value
from ivl.task import Task

if TYPE_CHECKING:
    from ivl.learning.loop import Progress

TASK_BASE = "experiments/paper_vertical.yaml"
"""Experiment that gives a bare task its policy, learner, reward and budget."""

Source = str | PathLike[str] | Experiment | Task
RewardLike = str | Reward | Callable[..., Any]
LearnerLike = str | type[Learner]


def learn(
    what: Source = "paper_flight",
    *,
    learner: LearnerLike | None = None,
    reward: RewardLike | None = None,
    seed: int | None = None,
    trials: int | None = None,
    out: str | PathLike[str] | None = None,
    resume: bool = False,
    earlier: Sequence[str | PathLike[str]] = (),
    threads: int | None = None,
    on_episode: "Callable[[Progress], None] | None" = None,
    **options: Any,
) -> LearnRun:
    """Learn to land in the simulator of this process, and judge what was learned; what `ivl learn` does.

    For example::

        ivl.learn("paper_vertical", learner="bo", budget=80)
        ivl.learn(ivl.Task(vehicle="habas2021", gear="wide_long", speed_mps=3.0, angle_deg=60.0), budget=80)
        ivl.learn("paper_vertical", **{"sense.latency": 0.02, "reward.options.weights": {"legs": 2.0}})

    Args:
        what: Name of a shipped experiment (`ivl list experiments`), path of a file, an experiment, or a task, which is
            learned with policy, learner and budget of `experiments/paper_vertical.yaml`.
        learner: Name (`ivl list learners`), `module:Class`, or a class of your own that can be imported; drops the
            learner options of `what`.
        reward: Name (`ivl list rewards`), `module:name`, a `Reward`, or a function of outcomes, likewise.
        seed: Seed of learner and world.
        trials: Learn so many seeds together: seed, seed + 1 ...; omitted: one.
        out: Run folder; omitted: a new one under `runs/`.
        resume: Continue the run in `out`.
        earlier: Run folders whose flights the learner is told first.
        threads: Worker threads; omitted: all processors. The bits do not depend on it.
        on_episode: Called after each stored episode.
        **options: Fields of the experiment (`budget=80`), and dotted paths of fields and of parameters of the world
            (`ivl list params`), as `ivl learn --set` takes them, with their values.

    Raises:
        ConfigError: A name, path or value is wrong; the message says what is allowed.
        StoreError: The run folder cannot be used.
    """
    from ivl import run as runs  # loads all that can judge and draw

    chosen = _experiment(what, learner, reward, seed, options)
    if resume and out is None:
        raise ConfigError("resume: needs the run folder: out=...")
    folder = runs.default_folder(chosen, trials, resume) if out is None else Path(out)
    hooks = runs.Hooks(on_episode=on_episode)
    done = runs.run(chosen, folder, trials, resume, threads, hooks, earlier=[Path(path) for path in earlier])
    return LearnRun(done.folder)


def _experiment(
    what: Source,
    learner: LearnerLike | None,
    reward: RewardLike | None,
    seed: int | None,
    options: Mapping[str, Any],
) -> Experiment:
    """The experiment that was asked for."""
    data, label = raw(what)
    experiment.replace(data, {"seed": seed})
    set_choices(data, learner, reward)
    for path, value in options.items():
        apply_value(data, path, plain(value), Experiment, label, "given to ivl.learn", path)
    return experiment.from_data(data, label)


def raw(what: Source) -> tuple[dict[str, Any], str]:
    """Raw data of an experiment, and what errors call it."""
    if isinstance(what, Experiment):
        return what.model_dump(), what.name
    if isinstance(what, Task):
        data, _ = experiment.read(TASK_BASE)
        kept = {name: value for name, value in data.items() if name not in Task.model_fields and name != "flown"}
        task = {name: value for name, value in what.model_dump().items() if name in Task.model_fields}
        return {**kept, **task, "name": "task", "doc": "A task that was given to ivl.learn."}, "task"
    if not isinstance(what, (str, PathLike)):
        kind = type(what).__name__
        raise ConfigError(f"{kind} is nothing to learn: give a name, a path, an Experiment or a Task")
    return experiment.read(str(what))


def set_choices(data: dict[str, Any], learner: LearnerLike | None, reward: RewardLike | None) -> None:
    """Write learner and reward into raw data; their options go where another one is chosen."""
    if learner is not None:
        data["learner"] = {"name": plugins.name_of(learner, LEARNERS)}
    if reward is not None:
        data["reward"] = {"name": plugins.name_of(reward, REWARDS)}


def plain(value: Any) -> Any:
    """A value as YAML would give it: numbers of numpy, tuples and arrays as Python's own."""
    if isinstance(value, Mapping):
        return {str(name): plain(each) for name, each in value.items()}
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, (list, tuple, range)):
        return [plain(each) for each in value]
    return str(value) if isinstance(value, PathLike) else value
