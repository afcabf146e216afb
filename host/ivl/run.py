"""A whole run from experiment to verdict: folder, learning, judging, pictures. What `ivl learn` does, as a function.

result = run(load("experiments/paper_vertical.yaml"), Path("runs/mine"))
print(result.summary["solved"], result.summary["mu"])
"""

import hashlib
import json
import os
import platform
import subprocess
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

import ivl
from ivl import (
    assess,
    experiment,
    family,
    files,
    forms,
    links,
    margin,
    native,
    numerics,
    plugins,
    references,
    sessions,
    yamlfile,
)
from ivl import flown as flown_landings
from ivl.belief.simulator import Simulator
from ivl.errors import ConfigError, StoreError
from ivl.experiment import Experiment
from ivl.layout import layout_of
from ivl.learners import LEARNERS
from ivl.learning.earlier import Earlier, gather
from ivl.learning.earlier import Source as EarlierRun
from ivl.learning.loop import LearningRun, Progress, recent_rate, trials_of
from ivl.learning.recorder import DISCARDED, SCORED, EpisodeRow, RolloutRows
from ivl.links.options import Options
from ivl.outcome import four_leg
from ivl.rewards import REWARDS
from ivl.settings import read_mapping
from ivl.site import file as site_file
from ivl.site import place
from ivl.source import RolloutSource, TrialSource, WorldSource
from ivl.store import EARLIER_FILE, SCHEMA_VERSION, RunStore, check_version, read_manifest, write_json
from ivl.world import World

_N_MARGIN = 100
"""Rollouts for each point of a recommendation's margin rate at an effort of 1, of each trial's vehicle."""
_MUST_MATCH = ("trials", "config_sha256")
_MUST_MATCH_BITS = ("uri", "model_sha256", "library_sha256")
"""Further fields of the manifest of a run that can be repeated bit for bit."""


@dataclass(frozen=True)
class Hooks:
    """Functions that a run calls on its way; each may be left out.

    Attributes:
        on_start: Run folder, known before the first rollout.
        on_episode: After each stored episode.
        on_bank: While simulated vehicles are flown before the first rollout: (vehicles done, vehicles).
        on_stage: Before each stage of the search for the best possible policy: (stage, number of stages).
        on_drone: Before that search on the vehicle of a trial that has its own: (trial, number of trials).
        on_note: What a reader of the results has to know, when it is known.
    """

    on_start: Callable[[Path], None] | None = None
    on_episode: Callable[[Progress], None] | None = None
    on_stage: Callable[[int, int], None] | None = None
    on_bank: Callable[[int, int], None] | None = None
    on_drone: Callable[[int, int], None] | None = None
    on_note: Callable[[str], None] | None = None


@dataclass(frozen=True)
class RunResult:
    """A finished run.

    Attributes:
        folder: The run folder.
        experiment: What was run.
        world: The world it ran in; that of the first trial where each has its own.
        best: The best possible policy there.
        verdicts: One per trial.
        history: Every episode of every trial.
        rollouts: Every rollout.
        summary: What `--json` prints.
    """

    folder: Path
    experiment: Experiment
    world: World
    best: assess.Best
    verdicts: list[assess.Verdict]
    history: list[EpisodeRow]
    rollouts: RolloutRows
    summary: dict[str, Any]


def run(
    chosen: Experiment,
    folder: Path,
    n_trials: int | None = None,
    resume: bool = False,
    threads: int | None = None,
    hooks: Hooks | None = None,
    uri: str | None = None,
    flight: Options | None = None,
    earlier: Sequence[Path] = (),
) -> RunResult:
    """Learn, judge and summarise; everything lands in `folder`.

    Args:
        chosen: The experiment.
        folder: Run folder; must not hold a run unless `resume`.
        n_trials: None: one run with its own summary; a number: so many seeds, summarised together.
        resume: Continue the run in `folder` (or re-judge it, if it is complete).
        threads: Worker threads; omitted: all processors.
        hooks: Progress.
        uri: Where to fly (see `ivl.links`); omitted: the simulator in this process, which also judges, wherever was
            flown.
        flight: How a vehicle is flown; its folder is the run folder.
        earlier: Run folders whose flights the learners are told first (`ivl.learning.earlier`), the earliest first;
            a run that is resumed has its own copy of them.

    Raises:
        ConfigError: An earlier run is of another task.
        StoreError: The folder cannot be used, or its run is of another configuration.
        RolloutError: Flying failed; the run can be resumed.
        LinkError: The vehicle at the end of the link cannot be reached.
    """
    hooks = hooks or Hooks()
    if resume and uri is None and (folder / "manifest.json").exists():
        sessions.refuse_without_link(folder, read_manifest(folder))
    worlds = chosen.trial_worlds(n_trials or 1)
    packed, copies = references.pack(chosen)
    each = n_trials is not None and chosen.family.is_each
    files_world = chosen.nominal_world_of(chosen.gear) if each else worlds[0]
    manifest = make_manifest(packed, files_world, n_trials, uri)
    if earlier and resume and (folder / "manifest.json").exists():
        raise ConfigError(f"--from: {folder} is resumed with the flights that it began with: leave it out")
    told = (
        gather([_read_run(run) for run in earlier], chosen, uri, each)
        if earlier
        else (kept_earlier(folder) if resume else None)
    )
    if told is not None:
        content = told.to_bytes()
        copies = copies | {EARLIER_FILE: content}
        manifest["earlier"] = {"runs": list(told.runs), "sha256": hashlib.sha256(content).hexdigest()}
    with ExitStack() as stack:
        simulator, notes = simulator_of(chosen, threads, hooks.on_bank, in_room=uri is not None)
        notes += [] if told is None else told.notes
        if hooks.on_note:
            for note in notes:
                hooks.on_note(note)
        source = _open_source(
            uri, chosen, worlds if each else worlds[0], threads, folder, flight, simulator is not None
        )
        stack.callback(source.close)
        if source.is_flown:
            manifest |= {"flown": True, "rehearsed": bool(flight and flight.rehearse)}
            manifest["sessions"] = [sessions.session_of(manifest, source.vehicle)]
        store, changed = _open(folder, packed, copies, manifest, resume)
        stack.enter_context(store)
        notes += changed
        if hooks.on_note:
            for note in changed:
                hooks.on_note(note)
        if hooks.on_start:
            hooks.on_start(folder)
        n_thinking = 1 if simulator is None else threads or len(os.sched_getaffinity(0))
        learning = LearningRun(trials_of(chosen, n_trials or 1), source, store, simulator, told, n_thinking)
        learning.run(hooks.on_episode)
        source.close()
        rollouts = store.rollouts()
        judging = [flown_landings.with_last_battery(worlds[0], chosen, rollouts)] if source.is_flown else worlds
        flown = _Flown(chosen, judging, each, store.episodes(), rollouts, threads)
        bests, verdicts, summary = _judge(flown, folder, n_trials, hooks)
        if source.is_flown:
            found = flown_landings.landings(folder, chosen, worlds[0], flown.rollouts)
            battery_V = flown_landings.last_rest_V(worlds[0], chosen, rollouts)
            summary["flown"] = flown_landings.summary(found, rollouts) | {"judged_battery_V": _json_number(battery_V)}
        summary |= {
            "run_dir": str(folder),
            "learner": chosen.learner.name,
            "earlier": None if told is None else {"runs": list(told.runs), "rollouts": len(told.theta)},
            "discarded": int((flown.rollouts.status == DISCARDED).sum()),
            "warnings": [*notes, *source.warnings],
        }
        write_json(folder / "result.json", {**summary, "verdicts": [asdict(v) for v in verdicts]})
    return RunResult(folder, chosen, worlds[0], bests[0], verdicts, flown.history, flown.rollouts, summary)


@dataclass(frozen=True)
class _Flown:
    """All that was flown, and where; `each`: trial k in `worlds[k]`, else all in the only one."""

    chosen: Experiment
    worlds: list[World]
    each: bool
    history: list[EpisodeRow]
    rollouts: RolloutRows
    threads: int | None

    def last(self, trial: int) -> EpisodeRow:
        """The last episode of a trial."""
        return max((row for row in self.history if row.trial == trial), key=lambda row: row.episode)

    def fits(self) -> list[bool | None]:
        """Whether the learner's model fits, of each trial; None: it has none."""
        insights = [self.last(trial).insight for trial in range(1 + max(row.trial for row in self.history))]
        return [None if insight is None else bool(insight["model_fits"]) for insight in insights]


def _judge(
    flown: _Flown, folder: Path, n_trials: int | None, hooks: Hooks
) -> tuple[list[assess.Best], list[assess.Verdict], dict[str, Any]]:
    """The best possible policies, a verdict for each trial, and the summary."""
    chosen, worlds, threads = flown.chosen, flown.worlds, flown.threads
    bests = _bests(flown, folder, hooks)
    if flown.each:
        verdicts = assess.judge_each(worlds, chosen, bests, flown.history, flown.rollouts, threads)
        summary = assess.summarise_each(verdicts, bests, flown.rollouts, flown.fits())
        summary |= {"margin_rate": _margin_rates(flown, bests), "best": [asdict(best) for best in bests]}
        return bests, verdicts, summary
    verdicts = assess.judge(worlds[0], chosen, bests[0], flown.history, flown.rollouts, threads)
    if n_trials:
        summary = assess.summarise(verdicts)
    else:
        summary = _summary_of_one(verdicts[0], flown.history, flown.rollouts)
        recommended = np.array(flown.last(0).recommended)
        summary |= {
            "model_fits": flown.fits()[0],
            "margin": margin.report(worlds[0], chosen, recommended, threads),
        }
    return bests, verdicts, {**summary, "best": asdict(bests[0])}


def _margin_rates(flown: _Flown, bests: list[assess.Best]) -> dict[str, float] | None:
    """Margin rates of the recommendations, each on its own vehicle, and that as a share of the largest one there."""
    if not assess.has_margin(flown.chosen):
        return None
    n_each = margin.scaled(flown.chosen, _N_MARGIN)
    rates = [
        assess.margin_rates(world, flown.chosen, np.array([flown.last(k).recommended]), n_each, flown.threads)[0]
        for k, world in enumerate(flown.worlds)
    ]
    shares = [
        rate / best.largest_margin_rate for rate, best in zip(rates, bests, strict=True) if best.largest_margin_rate
    ]
    share = {"share_of_largest": float(np.mean(shares))} if shares else {}
    return {"mean": float(np.mean(rates)), **share}


def _open_source(
    uri: str | None,
    chosen: Experiment,
    where: World | list[World],
    threads: int | None,
    folder: Path,
    flight: Options | None,
    record: bool,
) -> RolloutSource:
    if isinstance(where, list):
        if uri is None:
            return TrialSource(where, chosen, threads, record)
        each = f"{family.MEMBER}: {family.EACH}"
        raise ConfigError(f"{each}: {uri} flies one vehicle: name a member, or leave out --trials")
    if uri is None:
        return WorldSource(where, chosen, threads, record)
    return links.open_source(uri, chosen, threads, replace(flight or Options(), folder=folder), record)


def simulator_of(
    chosen: Experiment,
    threads: int | None = None,
    on_bank: Callable[[int, int], None] | None = None,
    in_room: bool = False,
) -> tuple[Simulator | None, list[str]]:
    """Simulated vehicles for a learner that begins with them, and why there are none.

    In a room with a site file they have any battery between just charged and too empty to begin, which lasts for many
    flights; elsewhere each flight has a battery of the vehicle file.
    """
    if not LEARNERS[chosen.learner.name].cls.uses_simulator:
        return None, []
    if chosen.policy.form != forms.PAPER:
        return None, [f"learned from flights alone: a belief knows policies of the form {forms.PAPER}"]
    home = chosen.nominal_world_of(chosen.gear)
    if not family.is_uncertain(home, chosen.family):
        return None, ["learned from flights alone: no parameter of the vehicle has a sigma"]
    flight = chosen.flight
    if in_room and chosen.site is not None and home.params.values[place.BATTERY] > 0.0:
        home = home.changed(**place.batteries(site_file.load(chosen.site)))
        flight = replace(flight, battery_lasts=True)
    kin = family.of(home, chosen.family)
    return Simulator.of(kin, flight, threads=threads, progress=on_bank), []


def kept_earlier(folder: Path) -> Earlier | None:
    """The flights of earlier runs with which a run began; None: with none, or there is no run yet."""
    kept = read_manifest(folder).get("earlier") if (folder / "manifest.json").exists() else None
    if kept is None:
        return None
    path = folder / EARLIER_FILE
    try:
        content = path.read_bytes()
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {files.reason(error)}") from error
    if hashlib.sha256(content).hexdigest() != kept["sha256"]:
        raise StoreError(f"{path}: is not as it was written")
    return Earlier.of_bytes(content)


def _read_run(folder: Path) -> EarlierRun:
    """An earlier run."""
    if folder.is_file():
        raise ConfigError(
            f"--from {folder}: is a file: name a run folder (--policy FILE begins with a policy's numbers)"
        )
    experiment, n_trials = read_config(folder)
    with RunStore.open_reading(folder, native.library().outcome_dtype) as store:
        return EarlierRun(folder, experiment, n_trials, read_manifest(folder).get("uri"), store.rollouts())


def read_config(folder: Path) -> tuple[Experiment, int | None]:
    """The experiment and the number of trials of an existing run folder.

    Raises:
        StoreError: There is no run, or another version of this program wrote it.
        ConfigError: Its configuration is damaged.
    """
    manifest = read_manifest(folder)
    check_version(folder, manifest, SCHEMA_VERSION)  # before the configuration, which may have changed its form too
    path = folder / "config.yaml"
    try:
        damaged = hashlib.sha256(path.read_bytes()).hexdigest() != manifest.get("config_sha256")
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {files.reason(error)}") from error
    if damaged:
        raise StoreError(f"{path}: is not as it was written")
    references.check(folder)
    data = read_mapping(path)
    return experiment.from_data(data, str(folder / "config.yaml")), manifest.get("trials")


def default_folder(chosen: Experiment, n_trials: int | None, resume: bool) -> Path:
    """A new folder under `runs/` named after the experiment; with `resume` the newest one of that name.

    Raises:
        StoreError: Nothing is there to resume.
    """
    base = f"{chosen.name}-{plugins.title(chosen.learner.name)}-seed{chosen.seed}" + (
        f"-x{n_trials}" if n_trials else ""
    )
    return numbered_folder(base, resume)


def numbered_folder(base: str, resume: bool) -> Path:
    """`runs/base`, `runs/base-2` ...: the first that is free, made; with `resume` the last that is there.

    Raises:
        StoreError: Nothing is there to resume, or the folder cannot be made.
    """
    existing = None
    for number in count(1):
        candidate = Path("runs") / (base if number == 1 else f"{base}-{number}")
        try:
            if not resume:
                candidate.mkdir(parents=True)  # of two programs that start at once, one gets it
                return candidate
            candidate.stat()
        except FileExistsError:
            continue
        except FileNotFoundError:
            break
        except OSError as error:
            raise StoreError(f"{candidate}: the run folder cannot be made: {files.reason(error)}") from error
        existing = candidate
    if existing is None:
        raise StoreError(f"runs/{base}: there is no run to resume; name its folder with --out")
    return existing


def make_manifest(
    chosen: Experiment, world: World, n_trials: int | None = None, uri: str | None = None
) -> dict[str, Any]:
    """What identifies a run: hashes, versions, seed and units."""
    library = native.library()
    return {
        "schema_version": SCHEMA_VERSION,
        "experiment": chosen.name,
        "seed": chosen.seed,
        "trials": n_trials,
        "uri": uri,
        "config_sha256": hashlib.sha256(chosen.to_yaml().encode()).hexdigest(),
        "model_sha256": world.params.digest(),
        "library_sha256": library.digest(),
        "ivl_version": ivl.__version__,
        "git_commit": git_commit(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numerics": numerics.kernel(),
        "platform": platform.platform(),
        "created_utc": datetime.now(UTC).isoformat(timespec="seconds"),
        "plugins": _plugins(chosen),
        "units": {f"out_{name}": field.unit for name, field in library.outcome_fields.items()},
        "parameters": {
            n: {"value": _json_number(v), "from": world.params.origin[n]} for n, v in world.params.values.items()
        },
    }


def _plugins(chosen: Experiment) -> dict[str, dict[str, Any]]:
    """Learner and reward that are not of this package."""
    names = {
        "learner": "" if chosen.learner.name in LEARNERS else chosen.learner.name,
        "reward": "" if chosen.reward.name in REWARDS else chosen.reward.name,
    }
    return plugins.described({field: name for field, name in names.items() if name})


def _open(
    folder: Path, chosen: Experiment, copies: dict[str, bytes], manifest: dict[str, Any], resume: bool
) -> tuple[RunStore, list[str]]:
    """The store of a run, and what is another one than in its last session."""
    dtype = native.library().outcome_dtype
    layout = layout_of(chosen)
    if not resume or not (folder / "manifest.json").exists():
        if resume and not folder.exists():
            raise StoreError(f"{folder}: there is no run to resume")
        return RunStore.create(folder, chosen.to_yaml(), manifest, dtype, layout, copies), []
    old = read_manifest(folder)
    check_version(folder, old, SCHEMA_VERSION)
    _refuse_other_run(folder, old, manifest, chosen)
    store = RunStore.open_existing(folder, dtype)
    if store.layout != layout:
        store.close()
        raise StoreError(
            f"{folder}: cannot be resumed: the terms of its reward or the parameters of its policy changed"
        )
    notes = [
        f"{field} {now['name']}: its source changed since the run began"
        for field, now in manifest["plugins"].items()
        if old.get("plugins", {}).get(field, now) != now
    ]
    if not old.get("flown"):
        return store, notes
    continued, changed = sessions.go_on(old, manifest["sessions"][0])
    write_json(folder / "manifest.json", continued)
    return store, [*notes, *changed]


def _refuse_other_run(folder: Path, old: dict[str, Any], manifest: dict[str, Any], chosen: Experiment) -> None:
    """Refuse to continue a run with another configuration, or with what cannot go on bit for bit if it has to."""
    sessions.refuse_other_kind(folder, old, manifest)
    for key in _MUST_MATCH if old.get("flown") else (*_MUST_MATCH, *_MUST_MATCH_BITS):
        if old.get(key) != manifest[key]:
            raise StoreError(f"{folder}: cannot be resumed: {_difference(folder, key, old, manifest, chosen)}")
    if not old.get("flown") and old.get("numerics", manifest["numerics"]) != manifest["numerics"]:
        raise StoreError(
            f"{folder}: cannot be resumed: it was computed by {old['numerics']}, here is {manifest['numerics']}, so "
            f"its search would not continue bit for bit ({numerics.ADVICE})"
        )


def _difference(folder: Path, key: str, old: dict[str, Any], new: dict[str, Any], chosen: Experiment) -> str:
    """Which thing is not as it was when the run began."""
    if key in ("trials", "uri"):
        return f"{key}: it has {old.get(key)}, now {new[key]}"
    if key == "config_sha256":
        then, now = yamlfile.read(folder / "config.yaml"), yamlfile.parse(chosen.to_yaml(), "experiment")
        for field in now:
            if then.get(field) != now[field]:
                return f"{field}: it has {then.get(field)!r}, now {now[field]!r}"
        return "its config.yaml was changed"
    what = "vehicle or gear files" if key == "model_sha256" else "native library"
    return f"the {what} changed since it began, so its rollouts would not continue bit for bit"


def _bests(flown: _Flown, folder: Path, hooks: Hooks) -> list[assess.Best]:
    """The best possible policy of each world, from the run folder if it was found before.

    The file holds one object, or a list of them where trials have vehicles of their own; each is kept when it is found.
    """
    path, worlds, each = folder / "best.json", flown.worlds, flown.each
    data = json.loads(path.read_text(encoding="utf-8")) if path.exists() else []
    bests = [assess.Best.of_dict(entry) for entry in (data if isinstance(data, list) else [data])]
    for trial in range(len(bests), len(worlds)):
        if each and hooks.on_drone:
            hooks.on_drone(trial, len(worlds))
        on_stage = None if each else hooks.on_stage
        bests.append(assess.find_best(worlds[trial], flown.chosen.trial(trial), flown.threads, on_stage))
        write_json(path, [asdict(best) for best in bests] if each else asdict(bests[0]))
    return bests


def _summary_of_one(verdict: assess.Verdict, history: list[EpisodeRow], rollouts: RolloutRows) -> dict[str, Any]:
    last = history[-1]
    return {
        "solved": verdict.solved,
        "rollouts_to_convergence": verdict.rollouts_to_convergence,
        "mu": list(last.mu),
        "sigma": list(last.sigma),
        "landing_rate_four_leg": _json_number(recent_rate(history)),
        "landing_rate_clean": _json_number(recent_rate(history, clean_only=True)),
        "failed_landings": verdict.failed_landings,
        "recommended": list(last.recommended),
        "recommended_rate_four_leg": verdict.rate_four_leg,
        "recommended_rate_clean": verdict.rate_clean,
        "failed_landings_total": verdict.failed_landings_total,
        "body_contacts": verdict.body_contacts,
        "stuck": verdict.stuck,
        "rollouts": int((rollouts.status == SCORED).sum()),
        "four_leg_landings": int((four_leg(rollouts.outcomes) & (rollouts.status == SCORED)).sum()),
    }


def _json_number(value: float) -> float | None:
    return value if np.isfinite(value) else None


def git_commit() -> str | None:
    """Commit of the source tree this package runs from; None outside of one."""
    command = ["git", "-C", str(Path(__file__).parent), "rev-parse", "HEAD"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=5, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None
