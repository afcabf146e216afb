"""What policies for every approach reach: the flights behind their section of docs/RESULTS.md.

Each part is a function that returns plain data. Policies are learned by `ivl.policy.learn`, from the shipped experiment
and settings that the data name, and are kept in a folder, so that a part that is measured again does not learn again.
"""

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import policy_oneclass

from ivl import forms as policy_forms
from ivl import native
from ivl.analysis.intervals import share_of, student95
from ivl.outcome import clean, four_leg
from ivl.policy import assess, file, general, learn
from ivl.policy.assess import Assessment
from ivl.policy.file import PolicyFile
from ivl.policy.flying import Drawn, Place, PolicyTask, fly, fly_own
from ivl.policy.flying import score as score_of
from ivl.policy.region import BOX, PLANE, Approaches, Series
from ivl.policy.shape import General, is_general
from ivl.policy.start import moment_most_Nmm, smooth
from ivl.seeds import Purpose, derive

EXPERIMENT = "experiments/general.yaml"
SEED = 7
"""Of all judgements; learning has the seed of the experiment, and no series of a purpose meets one of another."""
N_APPROACHES = 2000
QUICK = (
    "map.n_speeds=6", "map.n_angles=6", "map.n_thresholds=40", "map.moments_norm=[0.9]", "search.n_iterations=10",
    "search.n_approaches=30", "search.n_select=100", "go.n_approaches=100", "go.n_held_out=100",
)  # fmt: skip
"""A small budget, for gears, forms and families."""
OVER_BOX = ("regions=[box]", "search.n_approaches=60", "search.n_select=200")
LONG = (
    "regions=[box]", "search.n_iterations=40", "search.n_approaches=100", "search.n_select=400", "go.n_approaches=100",
    "go.n_held_out=100",
)  # fmt: skip
"""Six times as many flights over the box, for what is hard to land."""
ON = (
    "map.n_speeds=4", "map.n_angles=4", "map.n_thresholds=20", "map.moments_norm=[0.9]", "search.n_iterations=8",
    "search.n_approaches=50", "search.spread_per_s=0.15", "search.n_select=300", "go.n_approaches=100",
    "go.n_held_out=100",
)  # fmt: skip
"""The search on from the policy of ideal sensing, with other sensors."""
GO_ALONE = (*ON[:4], "search.n_iterations=0", "search.n_select=100", "go.n_approaches=4000", "go.n_held_out=2000")
"""The same thresholds, and go / no-go learned with other sensors."""
SENSORS = {
    "mocap": ("sensing=mocap",),
    "camera50": ("sensing=camera50", "estimator=kalman"),
    "camera50_delay20": ("sensing=camera50_delay20", "estimator=kalman"),
}
GEARS = ("extra_narrow_short", "narrow_short", "wide_short", "extra_narrow_long", "narrow_long", "wide_long")
HARD = ("wide_long",)
OTHER_FORMS = (("polynomial2", "wide_long"), ("bilinear", "wide_long"))
FLOWN = ("vehicle=crazyflie21", "gear_set=table1")
FORMS = ("polynomial2", "polynomial3", "bilinear")
FAMILY_ON = (
    "regions=[box]", *ON[:4], "search.n_iterations=40", "search.spread_per_s=0.2", "go.n_approaches=100",
    "go.n_held_out=100",
)  # fmt: skip
"""The search on from the policy of the nominal vehicle, with it or with drawn ones."""
N_FAMILY, N_DRAWN, N_EACH = 24, 40, 100
N_ONE_CLASS = 1000
Data = dict[str, Any]
FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Bench:
    """Where policies are kept, and who hears of the progress."""

    folder: Path
    say: Callable[[str], None]
    threads: int | None = None

    def learned(self, *settings: str, start: PolicyFile | None = None) -> PolicyFile:
        """The policy of the shipped experiment with some settings; learned once."""
        chosen = general.load([EXPERIMENT], settings)
        made_by = native.library().digest()
        text = json.dumps([chosen.model_dump(mode="json"), start.digest if start else None, made_by], sort_keys=True)
        path = self.folder / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.yaml"
        if not path.exists():
            self.say(f"learning: {' '.join(settings) or EXPERIMENT}")
            found = learn.learn(chosen, threads=self.threads, start=start)
            if found.training is None or found.training.interrupted:
                raise KeyboardInterrupt
            file.save(found, path)
        return file.load(path)

    def judged(self, policy: PolicyFile) -> Assessment:
        """On what it was learned on."""
        self.say(f"judging: {policy.form}, {policy.tasks[0].gear}, {policy.tasks[0].sensing or 'own sensors'}")
        return assess.assess(policy, None, N_APPROACHES, SEED, self.threads)


def about(policy: PolicyFile) -> Data:
    """What identifies a policy, and repeats it."""
    training = policy.training
    return {
        "form": policy.form,
        "theta": policy.values,
        "crc": f"{policy.checksum:08x}",
        "flights": training.rollouts if training else None,
    }


def sensors(bench: Bench) -> Data:
    """The default policy, and those that were searched on from it with other sensors."""
    ideal = bench.learned()
    found: Data = {"ideal": {**about(ideal), **over(bench, ideal, "box", "plane", "shaped")}}
    for name, regions in (("mocap", ("box",)), ("camera50_delay20", ("box", "plane", "shaped"))):
        own = bench.learned(*ON, *SENSORS[name], start=ideal)
        unchanged = over(bench, ideal.model_copy(update={"tasks": own.tasks}), "box")
        found[name] = {**about(own), **over(bench, own, *regions), "of_ideal": unchanged["box"]}
    return found


def go_no_go(bench: Bench) -> Data:
    """The default policy with a go / no-go that was learned with a camera, over the plane."""
    policy = bench.learned(*GO_ALONE, *SENSORS["camera50"], start=bench.learned())
    judged = bench.judged(policy)
    return {"camera50": {**about(policy), **judged.as_dict(), "clearance_m": clearance_m(bench, policy)}}


def clearance_m(bench: Bench, policy: PolicyFile) -> float:
    """Least distance from the ceiling of the refused approaches of `assess` that touched nothing."""
    place = Place.of(policy.tasks[0])
    approaches = assess.fresh(PLANE, N_APPROACHES, SEED)
    (flown,) = fly([place], policy.form, np.array(policy.values), approaches, bench.threads)
    return float(np.min(flown["d_min_m"][(flown["no_go"] == 1) & ~np.isfinite(flown["t_impact_s"])]))


@dataclass(frozen=True)
class Cells:
    """Middles of equal cells of the box, n approaches in each, with random numbers of their own."""

    n_axis: int = 6
    n_coarse: int = 2
    n_choose: int = 16
    n_judge: int = 50
    n_finalists: int = 5

    def approaches(self, n: int, first: int, purpose: Purpose) -> Approaches:
        """Shape (cells * n,), the n of a cell side by side."""
        axes = []
        for lo, hi in (BOX.speeds_mps, BOX.angles_deg):
            edges = np.linspace(lo, hi, self.n_axis + 1)
            axes.append(0.5 * (edges[1:] + edges[:-1]))
        speed, angle = (np.repeat(axis.reshape(-1), n) for axis in np.meshgrid(*axes, indexing="ij"))
        streams = np.arange(first, first + speed.size, dtype=np.uint64)
        return Approaches(speed, angle, streams, derive(SEED, purpose))


NOISY = Cells(n_coarse=6, n_choose=40, n_finalists=8)
"""More flights for the choice, where equal approaches of equal policies end differently."""


def ceiling(bench: Bench, task: PolicyTask, cells: Cells) -> tuple[FloatArray, Approaches]:
    """Landed and clean of the best RREV_c and M_yd of each cell, judged on other random numbers than chose it.

    The grid is smoothed over 5 ms of timing; the best few of a cell are flown again, and the best of them is judged.

    Returns:
        Shape (2,), and the approaches that judged.
    """
    bench.say(f"the best of each cell: {task.vehicle}, {task.gear}, {task.sensing or 'own sensors'}")
    place, n_cells = Place.of(task), cells.n_axis**2
    tau_s = np.linspace(0.12, 0.4, 36)
    moments = moment_most_Nmm([place]) * np.array([0.75, 0.9, 1.0])
    grid = np.stack(np.broadcast_arrays(1.0 / tau_s, moments[:, None]), axis=-1)  # (moments, thresholds, 2)
    coarse = cells.approaches(cells.n_coarse, 0, Purpose.GRID)
    (flown,) = fly([place], "constant", grid, coarse, bench.threads)
    scores = score_of(flown).reshape(*grid.shape[:2], n_cells, cells.n_coarse).mean(axis=-1)
    smoothed = smooth(scores, tau_s, 0.005).reshape(-1, n_cells)
    finalists = np.argsort(-smoothed, axis=0)[: cells.n_finalists]  # (finalists, cells)
    policies = grid.reshape(-1, 2)[finalists]
    chosen = _fly_cells(place, policies, cells.approaches(cells.n_choose, 0, Purpose.SELECT), bench.threads)
    best = score_of(chosen).mean(axis=-1).argmax(axis=0)
    judge = cells.approaches(cells.n_judge, 0, Purpose.ASSESS)
    final = _fly_cells(place, policies[best, np.arange(n_cells)][None], judge, bench.threads)
    return np.array([four_leg(final).mean(), clean(final).mean()]), judge


def _fly_cells(place: Place, policies: FloatArray, approaches: Approaches, threads: int | None) -> Any:
    """Outcomes (policies, cells, n) of policies (policies, cells, 2) that belong to a cell each."""
    n = len(approaches) // policies.shape[1]
    (flown,) = fly_own([place], "constant", np.repeat(policies, n, axis=1), approaches, threads)
    return flown.reshape(*policies.shape[:2], n)


def beside_ceiling(bench: Bench, policy: PolicyFile, cells: Cells | None = None) -> Data:
    """A policy over the box, and in cells beside the best of each cell on the same flights."""
    used = cells or Cells()
    place = Place.of(policy.tasks[0])
    best, approaches = ceiling(bench, policy.tasks[0], used)
    theta = General(policy.form).always_go(policy.values)
    (flown,) = fly([place], policy.form, theta, approaches, bench.threads)
    own = np.array([four_leg(flown).mean(), clean(flown).mean()])
    return {
        **over(bench, policy, "box"),
        "cells": {"landed": own[0], "clean": own[1], "flights": len(approaches)},
        "best": {"landed": best[0], "clean": best[1]},
        "ratio": {"landed": own[0] / best[0], "clean": own[1] / best[1]},
    }


def over(bench: Bench, policy: PolicyFile, *names: str) -> Data:
    """Landed and clean over fresh approaches of box, plane, or the plane with a shaped approach, every one flown."""
    theta = General(policy.form).always_go(policy.values) if is_general(policy.form) else np.array(policy.values)
    found: Data = {}
    for name in names:
        task = policy.tasks[0]
        bench.say(f"{N_APPROACHES} approaches, {name}: {task.vehicle}, {task.gear}, {task.sensing or 'own sensors'}")
        place = Place.of(assess.shaped(task) if name == "shaped" else task)
        approaches = Series([BOX if name == "box" else PLANE], SEED, Purpose.ASSESS).next(N_APPROACHES)
        (flown,) = fly([place], policy.form, theta, approaches, bench.threads)
        landed, spotless = share_of(four_leg(flown)), share_of(clean(flown))
        found[name] = {
            "landed": landed.value, "landed_interval": [landed.low, landed.high],
            "clean": spotless.value, "clean_interval": [spotless.low, spotless.high], "flights": landed.n,
        }  # fmt: skip
    return found


def gears(bench: Bench) -> Data:
    """Six gears of the authors' simulation, and the vehicle that flew, with a policy each."""
    found: Data = {}
    for gear in GEARS:
        policy = bench.learned(*(LONG if gear in HARD else (*QUICK, *OVER_BOX)), f"gear={gear}")
        found[f"habas2021, as_simulated, {gear}"] = {**about(policy), **beside_ceiling(bench, policy)}
    for form, gear in OTHER_FORMS:
        policy = bench.learned(*LONG, f"gear={gear}", f"form={form}")
        found[f"habas2021, as_simulated, {gear}, `{form}`"] = {**about(policy), **beside_ceiling(bench, policy)}
    for gear in ("wide_short", "wide_long"):
        policy = bench.learned(*LONG, *FLOWN, f"gear={gear}")
        found[f"crazyflie21, table1, {gear}"] = {**about(policy), **beside_ceiling(bench, policy, NOISY)}
    return found


def forms(bench: Bench) -> Data:
    """Each form after the same number of flights; the constant one takes the best of a grid."""
    policies = {name: about(bench.learned(*QUICK, f"form={name}")) for name in FORMS}
    policies["constant"] = _constant(bench, general.load([EXPERIMENT], QUICK))
    found: Data = {}
    for name, data in policies.items():
        policy = file.make(policy_forms.by_name(name), data["theta"], general.load([EXPERIMENT]).tasks, None, None)
        found[name] = {**data, **over(bench, policy, "box", "plane")}
    return found


def _constant(bench: Bench, chosen: general.GeneralExperiment) -> Data:
    """The best threshold and moment of a grid, over approaches of the search; about as many flights as the others."""
    place = Place.of(chosen.tasks[0])
    moments = moment_most_Nmm([place]) * np.array([0.75, 0.9, 1.0])
    grid = np.stack(np.broadcast_arrays(np.linspace(3.5, 6.0, 51), moments[:, None]), axis=-1).reshape(-1, 2)
    approaches = Series(list(chosen.regions), chosen.seed, Purpose.SEARCH).next(30)
    bench.say("grid of constant policies")
    (flown,) = fly([place], "constant", grid, approaches, bench.threads)
    best = grid[score_of(flown).mean(axis=-1).argmax()]
    made = file.make(policy_forms.by_name("constant"), best.tolist(), chosen.tasks, None, None)
    return {**about(made), "flights": int(flown.size)}


def family(bench: Bench) -> Data:
    """A policy of the nominal vehicle beside one of drawn vehicles, searched on from the same start."""
    found: Data = {}
    for gear in ("wide_long",):
        begin = bench.learned(*LONG, *FLOWN, f"gear={gear}")
        over_drawn = (f"drawn.n_vehicles={N_FAMILY}", "drawn.seed=1")
        policies = {
            "nominal": bench.learned(*FAMILY_ON, *FLOWN, f"gear={gear}", *_shared_by(1), start=begin),
            "family": bench.learned(
                *FAMILY_ON, *FLOWN, f"gear={gear}", *over_drawn, *_shared_by(N_FAMILY), start=begin
            ),
        }  # fmt: skip
        drawn = Drawn(n_vehicles=N_DRAWN, seed=SEED)
        places = Place.of(begin.tasks[0]).members(drawn, Purpose.FAMILY_ASSESS)
        batches = Series([BOX], SEED, Purpose.ASSESS).for_each(len(places), N_EACH)
        row: Data = {"vehicles": N_DRAWN, "flights": N_EACH, "learned_over": N_FAMILY}
        landed: dict[str, FloatArray] = {}
        for name, policy in policies.items():
            bench.say(f"{N_DRAWN} vehicles, {gear}: {name}")
            flown = fly(places, policy.form, General(policy.form).always_go(policy.values), batches, bench.threads)
            landed[name] = np.array([four_leg(o).mean() for o in flown])
            row[name] = {
                **about(policy),
                "landed": float(landed[name].mean()),
                "clean": float(np.mean([clean(o).mean() for o in flown])),
                "worst_tenth": float(np.sort(landed[name])[: -(-N_DRAWN // 10)].mean()),
                "nominal_box": over(bench, policy, "box")["box"],
            }
        gain = landed["family"] - landed["nominal"]
        half = float(student95(gain.size - 1) * gain.std(ddof=1) / np.sqrt(gain.size))
        row["gain"] = {"landed": float(gain.mean()), "half": half, "better": int((gain > 0).sum())}
        found[f"crazyflie21, table1, {gear}"] = row
    return found


def _shared_by(n_vehicles: int) -> tuple[str, str]:
    """The approaches of an iteration, and those of the choice, divided among vehicles."""
    return f"search.n_approaches={192 // n_vehicles}", f"search.n_select={1200 // n_vehicles}"


def one_class(bench: Bench) -> Data:
    """The one-class SVM with a network beside the default policy, over the box."""
    ideal = bench.learned()
    bench.say("one-class SVM")
    return {
        "box": policy_oneclass.compare(Place.of(ideal.tasks[0]), ideal.form, np.array(ideal.values), SEED, N_ONE_CLASS)
    }


PARTS: dict[str, Callable[[Bench], Data]] = {
    "sensors": sensors, "go": go_no_go, "gears": gears, "family": family, "forms": forms, "one_class": one_class,
}  # fmt: skip
