"""What policies for every approach reach: the flights behind their section of docs/RESULTS.md.

Each part is a function that returns plain data. Policies are learned by `ivl.policy.learn`, from the shipped experiment
and settings that the data name, and are kept in a folder, so that a part that is measured again does not learn again.
"""

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import policy_oneclass

from ivl import forms as policy_forms
from ivl import native
from ivl.analysis.intervals import share_of, student95, worst_tenth
from ivl.outcome import Outcomes, clean, four_leg
from ivl.policy import assess, file, general, learn
from ivl.policy.assess import Assessment
from ivl.policy.cells import Cells, Effort, best_of_cells
from ivl.policy.file import PolicyFile
from ivl.policy.flying import Drawn, Place, PolicyTask, fly, fly_own
from ivl.policy.flying import score as score_of
from ivl.policy.general import MapSettings
from ivl.policy.region import BOX, PLANE, Series
from ivl.policy.shape import General, is_general
from ivl.policy.start import moment_most_Nmm
from ivl.seeds import Purpose

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
"""Five times as many flights, over the box."""
LONGER = (*LONG, "search.n_iterations=100", "search.n_select=1000")
"""For what is hard to land."""
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
CELLS = MapSettings(
    n_speeds=12, n_angles=12, tau_s=[0.12, 0.4], n_thresholds=50, moments_norm=[0.7, 0.8, 0.9, 1.0]
)  # fmt: skip
"""Cells of the box, thresholds and moments, where the best of each cell is looked for.

Where landings lie on a narrow ridge one (RREV_c, M_yd) does not serve a large cell: the smaller the cells, the better
the best of each.
"""
EFFORT = Effort(n_coarse=2, n_finalists=8, n_choose=16)
NOISY = Effort(n_coarse=4, n_finalists=10, n_choose=40)
"""More flights where equal approaches of equal policies end differently."""
GEARS = ("extra_narrow_short", "narrow_short", "wide_short", "extra_narrow_long", "narrow_long", "wide_long")
HARD = ("narrow_long", "wide_long")
OTHER_FORMS = (("polynomial2", "wide_long"), ("bilinear", "wide_long"))
FLOWN = ("vehicle=crazyflie21", "gear_set=table1")
FLOWN_GEARS = ("wide_short", "wide_long")
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

    def kept(self, what: Data, measure: Callable[[], Any]) -> Any:
        """Plain data of a measurement, which `what` describes in full; with one simulator it is made once."""
        text = json.dumps([what, native.library().digest()], sort_keys=True)
        path = self.folder / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.json"
        if not path.exists():
            new = path.with_suffix(".new")
            new.write_text(json.dumps(measure()), encoding="utf-8")
            new.replace(path)
        return json.loads(path.read_text(encoding="utf-8"))

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


def beside_cells(bench: Bench, policy: PolicyFile, effort: Effort) -> Data:
    """A policy over the box beside the best (RREV_c, M_yd) of each cell, on the same fresh approaches."""
    task = policy.tasks[0]
    best = best_of_box(bench, task, effort)

    def measure() -> Data:
        place, approaches = Place.of(task), assess.fresh(BOX, N_APPROACHES, SEED)
        cells = Cells.of(BOX, CELLS.n_speeds, CELLS.n_angles)
        theta = np.array(best["theta"])[cells.number_of(approaches.speed_mps, approaches.angle_deg)]
        (own,) = fly([place], policy.form, General(policy.form).always_go(policy.values), approaches, bench.threads)
        (by_cell,) = fly_own([place], policy_forms.PAPER, theta, approaches, bench.threads)
        return {
            "box": rates(own),
            "best": {**rates(by_cell), "cells": len(best["theta"]), "search": best["flights"]},
            "ratio": {
                "landed": ratio(four_leg(own), four_leg(by_cell)),
                "clean": ratio(clean(own), clean(by_cell)),
                "score": ratio(score_of(own), score_of(by_cell)),
            },
        }

    what = {
        "beside": policy.values, "form": policy.form, "task": task.model_dump(mode="json"), "best": best, "seed": SEED,
        "n": N_APPROACHES,
    }  # fmt: skip
    found: Data = bench.kept(what, measure)
    return found


def best_of_box(bench: Bench, task: PolicyTask, effort: Effort) -> Data:
    """Threshold and moment of each of `CELLS`, and the flights that found them."""

    def measure() -> Data:
        bench.say(f"the best of each cell: {task.vehicle}, {task.gear}, {task.sensing or 'own sensors'}")
        best = best_of_cells(CELLS, BOX, SEED, [Place.of(task)], effort, bench.threads)
        return {"theta": best.theta.tolist(), "flights": best.n_flights}

    what = {
        "best": task.model_dump(mode="json"), "cells": CELLS.model_dump(mode="json"), "effort": asdict(effort),
        "seed": SEED,
    }  # fmt: skip
    found: Data = bench.kept(what, measure)
    return found


def ratio(values: npt.ArrayLike, others: npt.ArrayLike) -> Data:
    """Mean over mean of two measures of the same flights, with its 95 % interval."""
    a, b = np.asarray(values, dtype=np.float64), np.asarray(others, dtype=np.float64)
    value = float(a.mean() / b.mean())
    half = float(student95(a.size - 1) * (a - value * b).std(ddof=1) / (b.mean() * np.sqrt(a.size)))
    return {"value": value, "interval": [value - half, value + half]}


def over(bench: Bench, policy: PolicyFile, *names: str) -> Data:
    """Landed and clean over fresh approaches of box, plane, or the plane with a shaped approach, every one flown."""
    theta = General(policy.form).always_go(policy.values) if is_general(policy.form) else np.array(policy.values)
    found: Data = {}
    for name in names:
        task = policy.tasks[0]
        bench.say(f"{N_APPROACHES} approaches, {name}: {task.vehicle}, {task.gear}, {task.sensing or 'own sensors'}")
        place = Place.of(assess.shaped(task) if name == "shaped" else task)
        approaches = assess.fresh(BOX if name == "box" else PLANE, N_APPROACHES, SEED)
        (flown,) = fly([place], policy.form, theta, approaches, bench.threads)
        found[name] = rates(flown)
    return found


def rates(flown: Outcomes) -> Data:
    """Shares of landings and of clean ones."""
    landed, spotless = share_of(four_leg(flown)), share_of(clean(flown))
    return {
        "landed": landed.value, "landed_interval": [landed.low, landed.high],
        "clean": spotless.value, "clean_interval": [spotless.low, spotless.high], "flights": landed.n,
    }  # fmt: skip


def gears(bench: Bench) -> Data:
    """Six gears of the authors' simulation, and the vehicle that flew, with a policy each."""
    found: Data = {}
    for name, settings, effort in _of_gears():
        policy = bench.learned(*settings)
        found[name] = {**about(policy), **beside_cells(bench, policy, effort)}
    return found


def _of_gears() -> list[tuple[str, tuple[str, ...], Effort]]:
    """Title of a row, what its policy is learned with, and the effort for the best of each cell."""
    rows = [
        (f"habas2021, as_simulated, {gear}", (*(LONGER if gear in HARD else LONG), f"gear={gear}"), EFFORT)
        for gear in GEARS
    ]
    rows += [
        (f"habas2021, as_simulated, {gear}, `{form}`", (*LONGER, f"gear={gear}", f"form={form}"), EFFORT)
        for form, gear in OTHER_FORMS
    ]
    rows += [(f"crazyflie21, table1, {gear}", nominal(gear), NOISY) for gear in FLOWN_GEARS]
    return rows


def nominal(gear: str) -> tuple[str, ...]:
    """What the policy of the vehicle that flew is learned with."""
    return (*LONGER, *FLOWN, f"gear={gear}")


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
    return {f"crazyflie21, table1, {gear}": _family(bench, gear) for gear in ("wide_long",)}


def _family(bench: Bench, gear: str) -> Data:
    policies = {name: searched_on(bench, gear, name == "family") for name in ("nominal", "family")}
    places = Place.of(policies["nominal"].tasks[0]).members(Drawn(n_vehicles=N_DRAWN, seed=SEED), Purpose.FAMILY_ASSESS)
    batches = Series([BOX], SEED, Purpose.ASSESS).for_each(len(places), N_EACH)
    row: Data = {"vehicles": N_DRAWN, "flights": N_EACH, "learned_over": N_FAMILY}
    flights: dict[str, list[Outcomes]] = {}
    for name, policy in policies.items():
        bench.say(f"{N_DRAWN} vehicles, {gear}: {name}")
        theta = General(policy.form).always_go(policy.values)
        flights[name] = fly(places, policy.form, theta, batches, bench.threads)
        row[name] = {
            **about(policy), **of_vehicles(flights[name]), "nominal_box": over(bench, policy, "box")["box"],
        }  # fmt: skip
    gain = landed_of(flights["family"]) - landed_of(flights["nominal"])
    half = float(student95(gain.size - 1) * gain.std(ddof=1) / np.sqrt(gain.size))
    row["gain"] = {"landed": float(gain.mean()), "half": half, "better": int((gain > 0).sum())}
    return row


def landed_of(flown: Sequence[Outcomes]) -> FloatArray:
    """Share of landings of each vehicle."""
    return np.array([four_leg(outcomes).mean() for outcomes in flown])


def of_vehicles(flown: Sequence[Outcomes]) -> Data:
    """Landed and clean over all vehicles, and landed of those that land least."""
    landed = landed_of(flown)
    return {
        "landed": float(landed.mean()),
        "clean": float(np.mean([clean(outcomes).mean() for outcomes in flown])),
        "worst_tenth": worst_tenth(landed),
    }


def searched_on(bench: Bench, gear: str, over_drawn: bool) -> PolicyFile:
    """The search on from the policy of the vehicle of the files, on it or on drawn vehicles."""
    drawn = (f"drawn.n_vehicles={N_FAMILY}", "drawn.seed=1") if over_drawn else ()
    shared = _shared_by(N_FAMILY if over_drawn else 1)
    return bench.learned(*FAMILY_ON, *FLOWN, f"gear={gear}", *drawn, *shared, start=bench.learned(*nominal(gear)))


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
