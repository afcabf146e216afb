"""What the page of a policy for every approach shows: the numbers of its assessment, pictures, flights to replay."""

import base64
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ivl.analysis.intervals import Estimate
from ivl.errors import ConfigError
from ivl.landing import LandingSpec
from ivl.outcome import Outcomes, clean, four_leg
from ivl.plots import policy as pictures
from ivl.policy import go
from ivl.policy.assess import Assessment
from ivl.policy.file import PolicyFile
from ivl.policy.go import BoolArray
from ivl.policy.survey import Survey
from ivl.report import replay
from ivl.report.landings import Album
from ivl.report.page import flatten, parameter_names
from ivl.rewards import RewardChoice

_DPI = 130


def collect(policy: PolicyFile, name: str, found: Survey, judged: Assessment) -> tuple[dict[str, Any], Album]:
    """Data of the page, and its landings.

    Args:
        policy: The policy.
        name: What the page calls it.
        found: Flights of its pictures.
        judged: Its numbers.
    """
    album = Album(RewardChoice(name="paper"))
    notable = _notable(policy, found, album)
    data = {
        "title": f"Inverted landing: policy {name}",
        "subtitle": policy.shape.doc,
        "facts": [*_facts(policy), album.fact()],
        "manifest": flatten(policy.model_dump(mode="json")),
        "claims": None,
        "scale": replay.SCALE,
        "geometry": album.geometry,
        "landings": album.landings,
        "terms": [],
        "parameters": parameter_names(policy.shape),
        "policy": {"numbers": _numbers(judged), "pictures": _pictures(found), "notable": notable},
    }
    return data, album


def _facts(policy: PolicyFile) -> list[list[str]]:
    tasks = policy.tasks
    facts = [
        ["Vehicle and gear", "; ".join(dict.fromkeys(f"{t.vehicle}, {t.gear_set}/{t.gear}" for t in tasks))],
        ["Form", f"{policy.form}, {policy.shape.n} numbers"],
        ["Checksum on a vehicle", f"{policy.checksum:08x}"],
    ]
    if policy.training is not None:
        facts.append(["Learned by", f"{policy.training.learner.name}, {policy.training.rollouts} flights"])
    return facts


def _numbers(judged: Assessment) -> dict[str, Any]:
    """The assessment as a table: what, share, 95 % interval."""
    rows = []
    regions = (("box", judged.box), ("plane", judged.plane), ("plane, shaped approach", judged.shaped))
    for name, rates in regions:
        if rates is not None:
            rows += [_row(f"{name}: land", rates.landed), _row(f"{name}: land clean", rates.clean)]
    if judged.go is None:
        raise ConfigError("a form without go / no-go has no page")
    rows += [
        _row("go / no-go: refused", judged.go.no_go),
        _row("go / no-go: refused although they would land", judged.go.refused_good),
        _row("go / no-go: body strikes avoided", judged.go.strikes_avoided),
        _row("go / no-go: landings among those flown", judged.go.landed_of_flown),
        ["go / no-go: contacts in level-outs", str(judged.go.level_out_contacts), ""],
        ["go / no-go: contacts before the refusal", str(judged.go.contacts_before), ""],
        ["go / no-go: AUC", _number(judged.go.auc), ""],
        ["go / no-go: calibration error", _number(judged.go.calibration_error), ""],
        ["go / no-go: refused below a probability of", f"{judged.go.p_min:g}", ""],
    ]
    note = f"{judged.plane.n_flights} fresh flights of each region; rates of the regions are of every approach flown. "
    note += f"Vehicles: {judged.vehicles}."
    return {"head": ["", "value", "95 % interval"], "rows": rows, "note": note}


def _row(name: str, share: Estimate) -> list[str]:
    if not share.n:
        return [name, "–", "none to count"]
    return [name, f"{100 * share.value:.1f} %", f"{100 * share.low:.1f} to {100 * share.high:.1f} %, of {share.n}"]


def _number(value: float) -> str:
    return f"{value:.3f}" if np.isfinite(value) else "–"


def _pictures(found: Survey) -> list[dict[str, str]]:
    """Every picture as text that a browser shows without asking anybody."""
    result = []
    with tempfile.TemporaryDirectory() as folder:
        for picture in pictures.PICTURES:
            (path,) = picture.draw(found, [Path(folder) / f"{picture.name}.png"], _DPI)
            text = base64.b64encode(path.read_bytes()).decode()
            result.append({"name": picture.name, "title": picture.title, "source": f"data:image/png;base64,{text}"})
    return result


def _notable(policy: PolicyFile, found: Survey, album: Album) -> list[dict[str, Any]]:
    """A landing, a no-go, and what would have come of it; numbers of the album's landings."""
    flown = found.by_policy[0]
    refused = go.would_refuse(flown, found.p_min)
    own, free = found.theta, found.general.always_go(found.theta)
    landed = _first(clean(flown) & ~refused, four_leg(flown) & ~refused)
    wanted: list[tuple[str, int, Any, Callable[[Any], bool]]] = []
    if landed is not None:
        wanted.append(("landing", landed, own, _same(flown[landed])))
    told = refused & go.has_decided(flown)
    bad = _first(told & go.strikes(flown), told & ~four_leg(flown), told, refused)
    if bad is not None:
        wanted.append(("no-go", bad, own, lambda record: bool(record["no_go"] == 1)))
        wanted.append(("the same approach, had it been flown", bad, free, _same(flown[bad])))
    if not wanted:
        wanted.append(("flight that does not land", 0, own, _same(flown[0])))
    result = []
    for what, i, theta, as_recorded in wanted:
        result.append({"what": what, "landing": album.add(_spec(policy, found, i, theta), what, as_recorded)})
    return result


def _first(*masks: BoolArray) -> int | None:
    """The first flight of the first mask that has any."""
    for mask in masks:
        if mask.any():
            return int(np.argmax(mask))
    return None


def _same(flown: Any) -> Callable[[Any], bool]:
    """Whether an outcome is the one that was counted; what go / no-go decided does not count."""

    def same(record: Any) -> bool:
        batch: Outcomes = np.array([record], dtype=flown.dtype)
        names = ("n_legs", "body_contact", "base_contact", "t_trigger_s", "t_impact_s", "p_land")
        return all(np.array_equal(batch[0][n], flown[n], equal_nan=flown.dtype[n].kind == "f") for n in names)

    return same


def _spec(policy: PolicyFile, found: Survey, i: int, theta: Any) -> LandingSpec:
    task = policy.tasks[0]
    return LandingSpec(
        **task.setup(),
        gear=task.gear,
        form=policy.form,
        theta=np.asarray(theta).tolist(),
        speed_mps=float(found.approaches.speed_mps[i]),
        angle_deg=float(found.approaches.angle_deg[i]),
        seed=found.approaches.seed,
        stream=int(found.approaches.stream[i]),
    )
