"""How a replayed flight agrees with what was logged: cues of the approach, trigger, end of the flip, phases."""

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ivl import native
from ivl.flight import inputs, phases
from ivl.flight.inputs import Ticks
from ivl.flight.store import Flight, FloatArray

RREV_TOLERANCE_PER_S = 0.003
"""Differences of RREV up to this are called none: positions rounded to 1 mm make as much."""
RREV_SHARE, TRIGGER_SHARE = 0.95, 0.97
"""Shares of samples and of flights from which on the core is said to see, and to trigger, as logged."""

_CUES = (("rrev", "rrev_per_s", "per_s"), ("of_y", "of_y_radps", "radps"), ("d_ceil", "d_ceil_m", "m"))
_QUANTILES = (("median", 0.5), ("q95", 0.95), ("max", 1.0))


@dataclass(frozen=True)
class Replayed:
    """One flight, replayed.

    Attributes:
        flight: As recorded.
        ticks: What the core was told.
        rows: What it answered, one record of the library's table of replay rows a tick.
    """

    flight: Flight
    ticks: Ticks
    rows: npt.NDArray[np.void]

    @property
    def tick_s(self) -> float:
        """Period of the core."""
        return 1.0 / float(self.ticks.config["ivl.tick_hz"][0])

    def at_samples(self, name: str) -> FloatArray:
        """One field of the answers at the ticks that see the samples, shape (n_samples,)."""
        return np.asarray(self.rows[name][self.ticks.seen], dtype=np.float64)

    def first(self, on: npt.NDArray[np.bool_]) -> float | None:
        """Time of the first tick of which `on` is true, on the flight's clock; None if there is none."""
        return float(self.flight["t_s"][0] + np.argmax(on) * self.tick_s) if on.any() else None

    @property
    def trigger_s(self) -> float | None:
        """Time of the tick that triggered."""
        return self.first(self.rows["triggered"] != 0)

    @property
    def logged_trigger_s(self) -> float | None:
        """Time of the first sample after the trigger, as logged."""
        sample = inputs.trigger_sample(self.flight)
        return None if sample is None else float(self.flight["t_s"][sample])

    @property
    def judges_trigger(self) -> bool:
        """True if policy and trigger are in the log, and the flight has an approach."""
        known = inputs.tells_trigger(self.flight) and np.isfinite(self.flight.info["threshold_per_s"])
        return bool(known and self.ticks.begins < len(self.flight))

    def sample_of(self, t_s: float) -> int:
        """First sample that is not before an instant, as far as ticks resolve it."""
        return int(np.searchsorted(self.flight["t_s"], t_s - 0.5 * self.tick_s))

    def news(self) -> npt.NDArray[np.bool_]:
        """False for samples whose position and velocity repeat those before: no new packet had come."""
        motion = np.hstack([self.flight.stack("p", "xyz", "m"), self.flight.stack("v", "xyz", "mps")])
        return np.append(True, (np.diff(motion, axis=0) != 0.0).any(axis=1))

    def approach(self) -> npt.NDArray[np.bool_]:
        """Samples that the core was fed from the begin of the approach until the trigger.

        The trigger is the logged one, or the replayed one if none was logged.
        """
        number = np.arange(len(self.flight))
        trigger_s = self.trigger_s if self.logged_trigger_s is None else self.logged_trigger_s
        end = len(number) if trigger_s is None else self.sample_of(trigger_s)
        return self.ticks.fed & (number >= self.ticks.begins) & (number < end)


def summary(replayed: Sequence[Replayed], step: float) -> dict[str, Any]:
    """The whole comparison as one JSON object; see docs/REPLAY.md for its members."""
    flights = [_of_flight(r, step) for r in replayed]
    return {
        "n_flights": len(replayed),
        "n_samples": sum(f["n_samples"] for f in flights),
        "n_ticks": sum(len(r.rows) for r in replayed),
        **_cues(replayed, step),
        "trigger": _triggers([f["trigger"] for f in flights if f["trigger"]]),
        "cut": _offsets([f["cut"] for f in flights]),
        "phase": {name: sum(f["phase"][name] for f in flights) for name in ("n_samples", "n_different", "n_ticks")},
        "flights": flights,
    }


def bits(replayed: Iterable[Replayed]) -> str:
    """SHA-256 of all answers, field by field: equal exactly if no bit differs."""
    digest = hashlib.sha256()
    for r in replayed:
        for name in r.rows.dtype.names or ():
            digest.update(r.rows[name].tobytes())
    return digest.hexdigest()


def _of_flight(r: Replayed, step: float) -> dict[str, Any]:
    begins = r.ticks.begins
    return {
        "flight": int(r.flight.info["flight"]),
        "label": r.flight.label,
        "approach_s": float(r.flight["t_s"][begins]) if begins < len(r.flight) else None,
        "approach_told_by": r.ticks.begun_by,
        "n_samples": int(r.approach().sum()),
        **_cues([r], step),
        "trigger": _event(r, r.logged_trigger_s, r.trigger_s) if r.judges_trigger else None,
        "cut": _event(r, _logged_cut_s(r), r.first((r.rows["triggered"] != 0) & (r.rows["phase"] > phases.FLIP))),
        "phase": _phases(r),
        "last_phase": native.library().phase_name(int(r.rows["phase"][-1])),
        "ended_early_by": _ended_early_by(r),
        "n_bad_pose": int(r.rows["n_bad_pose"][-1]),
        "notes": list(r.ticks.notes),
    }


# ---- cues


def _cues(replayed: Sequence[Replayed], step: float) -> dict[str, Any]:
    """Differences of each cue over the approaches."""
    cues = {}
    for key, column, unit in _CUES:
        error, scale = (np.concatenate(parts) for parts in zip(*(_errors(r, column) for r in replayed), strict=True))
        cues[key] = _distribution(error, unit)
        if key == "rrev":
            cues[key]["within_0_003"] = _share(error <= RREV_TOLERANCE_PER_S)
            cues[key]["explained_by_step"] = _share(error <= step * scale) if step > 0.0 else None
    return cues


def _errors(r: Replayed, column: str) -> tuple[FloatArray, FloatArray]:
    """Sizes of the differences in the approach, and what a log that is cut to 1 would make of RREV there.

    Where the log has a cue and the core has none the difference is infinite.
    """
    logged = r.flight[column]
    chosen = r.approach() & np.isfinite(logged)
    found = np.where(r.at_samples("cue_valid") != 0.0, r.at_samples(column), np.inf)[chosen]
    d_m, rrev_per_s = r.at_samples("d_ceil_m")[chosen], r.at_samples("rrev_per_s")[chosen]
    scale = 1.0 + (1.0 + np.abs(rrev_per_s)) / np.maximum(d_m, 1.0e-3)
    return np.abs(found - logged[chosen]), scale


def _distribution(error: FloatArray, unit: str) -> dict[str, Any]:
    seen = error[np.isfinite(error)]
    sizes = {f"{name}_error_{unit}": float(np.quantile(seen, q)) if len(seen) else None for name, q in _QUANTILES}
    return {"n": len(error), "n_blind": len(error) - len(seen), **sizes}


def _share(true: npt.NDArray[np.bool_]) -> float | None:
    return float(true.mean()) if len(true) else None


# ---- trigger, end of the flip, phases


def _event(r: Replayed, logged_s: float | None, replayed_s: float | None) -> dict[str, Any]:
    """When it happened on the flight's clock, and how much later in the replay; None where it did not."""
    offsets: dict[str, Any] = {"offset_samples": None, "offset_new_samples": None, "offset_s": None}
    if logged_s is not None and replayed_s is not None:
        logged, replayed = r.sample_of(logged_s), r.sample_of(replayed_s)
        n_new = int(r.news()[min(logged, replayed) + 1 : max(logged, replayed) + 1].sum())
        offsets = {
            "offset_samples": replayed - logged,
            "offset_new_samples": n_new if replayed > logged else -n_new,
            "offset_s": round(replayed_s - logged_s, 6) + 0.0,  # no negative zero
        }
    return {"logged_s": logged_s, "replayed_s": replayed_s, **offsets}


def _logged_cut_s(r: Replayed) -> float | None:
    """When the flip's motors went off, as the logged moment tells it."""
    trigger, moment = inputs.trigger_sample(r.flight), r.flight["moment_cmd_y_Nm"]
    if trigger is None or not np.isfinite(moment[trigger]) or moment[trigger] == 0.0:
        return None
    off = np.flatnonzero(moment[trigger:] == 0.0)
    return float(r.flight["t_s"][trigger + off[0]]) if len(off) else None


def _offsets(events: Iterable[dict[str, Any]]) -> dict[str, Any]:
    """Offsets of the events that happened in both."""
    both = [event for event in events if event["offset_s"] is not None]
    return {
        "n": len(both),
        "within_one_sample": _within_one(both, "offset_samples"),
        "within_one_new_sample": _within_one(both, "offset_new_samples"),
        "offsets_samples": [event["offset_samples"] for event in both],
        "offsets_s": [event["offset_s"] for event in both],
    }


def _triggers(events: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """As `_offsets`; a flight that triggered in one and not in the other is not within one sample."""
    happened = [(event["logged_s"] is not None, event["replayed_s"] is not None) for event in events]
    return {
        **_offsets(events),
        "n": len(events),
        "n_logged_only": happened.count((True, False)),
        "n_replayed_only": happened.count((False, True)),
        "n_neither": happened.count((False, False)),
        "within_one_sample": _within_one(events, "offset_samples"),
        "within_one_new_sample": _within_one(events, "offset_new_samples"),
    }


def _within_one(events: Sequence[dict[str, Any]], name: str) -> float | None:
    """Share of events that are at most one sample apart, or that happened in neither."""
    neither = [event["logged_s"] is None and event["replayed_s"] is None for event in events]
    close = [event[name] is not None and abs(event[name]) <= 1 for event in events]
    return _share(np.array(neither) | np.array(close)) if events else None


def _phases(r: Replayed) -> dict[str, int]:
    """Samples whose logged phase is another than the replayed one, and the ticks for which that lasts."""
    logged = r.flight["phase"]
    chosen = r.ticks.fed & np.isfinite(logged)
    different = chosen & (logged != r.at_samples("phase"))
    lasts = np.append(np.diff(r.ticks.seen), 1)
    return {
        "n_samples": int(chosen.sum()),
        "n_different": int(different.sum()),
        "n_ticks": int(lasts[different].sum()),
    }


def _ended_early_by(r: Replayed) -> str:
    """Safety rule that ended the replayed approach, or kept it from beginning; empty if none did before the trigger."""
    trigger = inputs.trigger_sample(r.flight)
    rows = r.rows if trigger is None else r.rows[: int(r.ticks.seen[trigger]) + 1]
    aborted = rows["phase"] == phases.ABORTED
    if aborted.any():
        return native.library().rule_name(int(rows["cause"][np.argmax(aborted)]))
    in_vain = r.ticks.begins < len(r.flight) and not (rows["phase"] >= phases.APPROACH).any()
    return native.library().rule_name(int(rows["rule"][-1])) if in_vain else ""


# ---- sentences


def verdict(summary: dict[str, Any]) -> list[str]:
    """What a summary says, one sentence each."""
    return [*_cue_verdict(summary["rrev"]), *_event_verdict(summary), *_early_verdict(summary["flights"])]


def _cue_verdict(rrev: dict[str, Any]) -> list[str]:
    if not rrev["n"]:
        return ["The log has no RREV to compare with."]
    within, explained = rrev["within_0_003"], rrev["explained_by_step"]
    sees = "sees" if max(within, explained or 0.0) >= RREV_SHARE else "does not see"
    by_step = "" if explained is None else f"; the log's resolution explains {100 * explained:.1f} %"
    lines = [
        f"The core {sees} the logged RREV: {100 * within:.1f} % of {rrev['n']} samples within "
        f"{RREV_TOLERANCE_PER_S:g} 1/s (wanted {100 * RREV_SHARE:g} %){by_step}."
    ]
    if rrev["n_blind"]:
        lines.append(f"The core has no valid cue at {rrev['n_blind']} samples where the log has one.")
    return lines


def _event_verdict(summary: dict[str, Any]) -> list[str]:
    trigger, cut, phase = summary["trigger"], summary["cut"], summary["phase"]
    lines = _trigger_verdict(trigger) if trigger["n"] else ["The log tells too little to compare the trigger."]
    if cut["n"]:
        lines.append(f"Motors go off within one sample in {100 * cut['within_one_sample']:.1f} % of {cut['n']} flips.")
    if phase["n_samples"]:
        n_different, n_samples, n_ticks = (phase[name] for name in ("n_different", "n_samples", "n_ticks"))
        lines.append(f"The phase differs at {n_different} of {n_samples} samples, which last {n_ticks} ticks.")
    return lines


def _trigger_verdict(trigger: dict[str, Any]) -> list[str]:
    within, within_new = trigger["within_one_sample"], trigger["within_one_new_sample"]
    triggers = "triggers" if within >= TRIGGER_SHARE else "does not trigger"
    lines = [
        f"It {triggers} as logged: {100 * within:.1f} % of {trigger['n']} flights within one sample "
        f"(wanted {100 * TRIGGER_SHARE:g} %)."
    ]
    if within_new > within:
        lines.append(
            f"Not counting samples that repeat the one before, {100 * within_new:.1f} % are within one sample."
        )
    n_logged, n_replayed = trigger["n_logged_only"], trigger["n_replayed_only"]
    if n_logged or n_replayed:
        lines.append(f"{n_logged} flights triggered in the log alone, {n_replayed} in the replay alone.")
    return lines


def _early_verdict(flights: Sequence[dict[str, Any]]) -> list[str]:
    rules = [flight["ended_early_by"] for flight in flights if flight["ended_early_by"]]
    counted = ", ".join(f"{rule} ({rules.count(rule)})" for rule in sorted(set(rules)))
    return [f"Rules of the core ended approaches before the trigger: {counted}."] if rules else []
