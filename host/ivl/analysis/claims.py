"""The paper's nine claims, each tried on a campaign: number, verdict, what was found, and the command that makes it.

A verdict follows from the numbers by the rule that is written at its function, and from nothing else:
`yes`, `partly`, `no`, or `not measured` where the campaign lacks what the claim is about.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass, field

import numpy as np
import pandas as pd  # type: ignore[import-untyped]

from ivl import model
from ivl.analysis import region
from ivl.analysis.contact import contact_order
from ivl.analysis.intervals import Estimate, difference
from ivl.analysis.moment import explained
from ivl.analysis.policy import MOMENT, THRESHOLD, recommended
from ivl.analysis.rates import RATE, cell_rates, compare, mean_rate, profile
from ivl.analysis.separability import auc_gain, separability
from ivl.outcome import SOLVED_SHARE, solved

YES, PARTLY, NO, NOT_MEASURED = "yes", "partly", "no", "not measured"
PAPER_GEAR = "wide_short"
SLOW_UP_TO_MPS = 2.0
"""Half of the paper's range of speeds: up to here an approach is slow, above it is fast."""
PAPER_POLICY = (4.64, 8.09)
"""RREV_c (1/s) and M_yd (N mm) of the paper's simulation near 2.5 m/s vertical."""
POLICY_NEAR = (0.3, 1.0)
"""How far from it still counts as near."""
WIDTHS = ("extra_narrow", "narrow", "wide")

Numbers = dict[str, Estimate | float]


@dataclass(frozen=True)
class Claim:
    """One claim and how it fared.

    Attributes:
        number: As in docs/MODEL.md and the paper's order.
        text: The claim.
        verdict: `yes`, `partly`, `no` or `not measured`.
        finding: One or two sentences with the numbers that decide.
        numbers: The same as data, by name; units in the names.
        command: What makes them.
    """

    number: int
    text: str
    verdict: str
    finding: str
    numbers: Numbers = field(default_factory=dict)
    command: str = "ivl sweep sweeps/paper.yaml"


Found = tuple[str, str, Numbers]


def evaluate(trials: pd.DataFrame, numbers: Collection[int] = range(1, 10)) -> list[Claim]:
    """Try the claims.

    Args:
        trials: Table of trials of one vehicle, gear set and learner; with the column `rollouts_to_rate` (see
            `rates.rollouts_to_rate`) convergence is judged too.
        numbers: Which claims.

    Raises:
        ValueError: The trials are of more than one vehicle, gear set or learner.
    """
    for column in ("vehicle", "gear_set", "learner"):
        if trials[column].nunique() > 1:
            raise ValueError(f"claims: the trials are of more than one {column}")
    chosen = [(number, *CLAIMS[number - 1]) for number in sorted(numbers)]
    return [Claim(number, text, *rule(trials)) for number, text, rule in chosen]


def show(estimate: Estimate, digits: int = 2) -> str:
    """A number with its interval, for a sentence."""
    value, low, high = (f"{round(x, digits) + 0.0:.{digits}f}" for x in (estimate.value, estimate.low, estimate.high))
    return f"{value} ({low} to {high})"


def _gear(trials: pd.DataFrame, gear: str) -> pd.DataFrame:
    return trials[trials["gear"] == gear]


def _gears(trials: pd.DataFrame) -> list[str]:
    return sorted(trials["gear"].astype(str).unique())


def _unmeasured(what: str) -> Found:
    return NOT_MEASURED, f"The campaign has no {what}.", {}


def _convergence(trials: pd.DataFrame) -> Found:
    """Yes: mean rate > 0.9, median within 104 rollouts (13 episodes), policy near the paper's; partly: the first."""
    own = _gear(trials, PAPER_GEAR)
    own = own[(own["speed_mps"] == 2.5) & (own["angle_deg"] == 90.0)]
    if own.empty:
        return _unmeasured("Wide-Short at 2.5 m/s, 90 degrees")
    cell = cell_rates(own).iloc[0]
    mean, low, high = (float(cell[f"rate_{end}_norm"]) for end in ("mean", "low", "high"))
    rate = Estimate(mean, low, high, int(cell["n_trials"]))
    rrev, moment = (float(own[recommended(i)].median()) for i in (THRESHOLD, MOMENT))
    needed = float(own["rollouts_to_rate"].fillna(np.inf).median()) if "rollouts_to_rate" in own else float("nan")
    near = all(abs(a - b) <= c for a, b, c in zip((rrev, moment), PAPER_POLICY, POLICY_NEAR, strict=True))
    lands, soon = rate.value > 0.9, needed <= 104
    verdict = YES if lands and soon and near else PARTLY if lands else NO
    when = f"after {needed:.0f} rollouts (median)" if np.isfinite(needed) else "at no time in the median trial"
    finding = (
        f"{len(own)} trials: landing rate {show(rate)}; it reaches {SOLVED_SHARE} for good {when}; "
        f"policy RREV_c {rrev:.2f} 1/s, M_yd {moment:.2f} N mm (medians)."
    )
    return verdict, finding, {
        "rate_norm": rate, "rollouts_to_rate": needed, "threshold_per_s": rrev, "moment_Nmm": moment,
    }  # fmt: skip


def _auc(trials: pd.DataFrame, space: str) -> Estimate:
    points = region.trial_points(trials)
    if points.empty:
        return Estimate(float("nan"), 0.0, 1.0, 0)
    return separability(points[list(region.CUE_SETS[space])], points["success"], points["condition"]).auc


def _one_region(trials: pd.DataFrame) -> Found:
    """Yes: in all gears AUC >= 0.9 (lower end) and 95 % of the solved cells in one part; partly: one of both in all."""
    aucs, parts = {}, {}
    for gear in _gears(trials):
        cells = cell_rates(_gear(trials, gear))
        found = region.components(cells.assign(success=cells["n_solved"] > 0), ["speed_mps", "angle_deg"])
        if found.n_points:
            parts[gear], aucs[gear] = found, _auc(_gear(trials, gear), "state")
    if not parts:
        return _unmeasured("solved cell")
    apart = all(auc.low >= 0.9 for auc in aucs.values())
    whole = all(part.largest_share >= 0.95 for part in parts.values())
    verdict = YES if apart and whole else PARTLY if apart or whole else NO
    worst = min(parts, key=lambda g: parts[g].largest_share)
    lowest = min(aucs, key=lambda g: aucs[g].value)
    finding = (
        f"AUC in (Vx, Vz, d) is {show(aucs[lowest])} in the worst gear ({model.gear_title(lowest)}); "
        "the largest connected part holds "
        f"{100 * parts[worst].largest_share:.0f} % of the solved cells or more, with at most "
        f"{max(p.n_holes for p in parts.values())} unsolved cells enclosed. The region is open towards 4 m/s, where "
        "the sweep ends."
    )
    numbers: Numbers = {f"auc_{g}": aucs[g] for g in aucs}
    return verdict, finding, {**numbers, **{f"largest_share_{g}_norm": parts[g].largest_share for g in parts}}


def _cues(trials: pd.DataFrame) -> tuple[Estimate, Estimate, Estimate]:
    """AUC of Wide-Short in flow space, in the augmented space, and the gain of the second over the first."""
    points = region.trial_points(_gear(trials, PAPER_GEAR))
    if points.empty:
        nothing = Estimate(float("nan"), 0.0, 1.0, 0)
        return nothing, nothing, nothing
    spaces = [points[list(region.CUE_SETS[space])] for space in ("flow", "augmented")]
    flow, augmented = (separability(cues, points["success"], points["condition"]).auc for cues in spaces)
    return flow, augmented, auc_gain(spaces[1], spaces[0], points["success"], points["condition"])


def _flow_overlaps(trials: pd.DataFrame) -> Found:
    """Yes: AUC in flow space below 0.9 (upper end); partly: below that with d (paired, lower end of the gain > 0)."""
    flow, augmented, gain = _cues(trials)
    if not np.isfinite(flow.value):
        return _unmeasured("Wide-Short with both solved and unsolved trials")
    verdict = YES if flow.high < 0.9 else PARTLY if gain.low > 0 else NO
    finding = f"Wide-Short: AUC in (RREV, OF_y) is {show(flow, 3)}; d adds {show(gain, 3)}."
    return verdict, finding, {"auc_flow": flow, "auc_augmented": augmented, "auc_gain": gain}


def _augmented_separates(trials: pd.DataFrame) -> Found:
    """Yes: AUC with d of at least 0.95 (lower end), and d adds to it (paired, lower end > 0); partly: 0.7 instead."""
    flow, augmented, gain = _cues(trials)
    if not np.isfinite(augmented.value):
        return _unmeasured("Wide-Short with both solved and unsolved trials")
    verdict = NO if gain.low <= 0 or augmented.low < 0.7 else YES if augmented.low >= 0.95 else PARTLY
    finding = f"Wide-Short: AUC in (RREV, OF_y, d) is {show(augmented, 3)}; without d it is less by {show(gain, 3)}."
    return verdict, finding, {"auc_flow": flow, "auc_augmented": augmented, "auc_gain": gain}


def _nonlinear_moment(trials: pd.DataFrame) -> Found:
    """Yes: a forest explains half of M_yd (lower end) and more than a plane; partly: more than a plane."""
    points = region.trial_points(_gear(trials, PAPER_GEAR))
    points = points[points["success"]]
    if points["condition"].nunique() < 2 or points["moment_Nmm"].nunique() < 2:
        return _unmeasured("two solved approaches of Wide-Short with different moments")
    result = explained(points[list(region.AUGMENTED)], points["moment_Nmm"], points["condition"])
    more = result.gain.low > 0
    verdict = YES if more and result.nonlinear.low >= 0.5 else PARTLY if more else NO
    finding = (
        f"Wide-Short, {result.n_points} solved trials: R2 of M_yd from (RREV, OF_y, d) is {show(result.linear)} with a "
        f"plane, {show(result.nonlinear)} with a forest; M_yd lies between {points['moment_Nmm'].quantile(0.05):.1f} "
        f"and {points['moment_Nmm'].quantile(0.95):.1f} N mm (5 to 95 %)."
    )
    return verdict, finding, {"r2_plane": result.linear, "r2_forest": result.nonlinear, "r2_gain": result.gain}


def _fast_is_best(trials: pd.DataFrame) -> Found:
    """Yes: every gear lands more often above `SLOW_UP_TO_MPS` than below, and best at 3 m/s or more; partly: some."""
    gain, best = {}, {}
    slow = trials["speed_mps"] <= SLOW_UP_TO_MPS
    if not slow.any() or slow.all():
        return _unmeasured("both slow and fast approaches")
    for gear in _gears(trials):
        own = _gear(trials, gear)
        is_slow = own["speed_mps"] <= SLOW_UP_TO_MPS
        gain[gear] = difference(mean_rate(own[~is_slow]), mean_rate(own[is_slow]))
        by_speed = profile(own, "speed_mps")
        best[gear] = float(by_speed.loc[by_speed["rate_norm"].idxmax(), "speed_mps"])
    good = [g for g in gain if gain[g].low > 0 and best[g] >= 3.0]
    verdict = YES if len(good) == len(gain) else PARTLY if good else NO
    least = min(gain, key=lambda g: gain[g].value)
    finding = (
        f"Above {SLOW_UP_TO_MPS:g} m/s the landing rate is higher by {show(gain[least])} in the gear that gains least "
        f"({model.gear_title(least)}); the best speed of a gear is {min(best.values()):g} m/s at least."
    )
    return verdict, finding, {**{f"gain_{g}_norm": gain[g] for g in gain}, **{f"best_{g}_mps": best[g] for g in best}}


def _long_beats_short(trials: pd.DataFrame) -> Found:
    """Yes: in all three widths long legs land more often at slow approaches (lower end > 0); partly: in some."""
    slow = trials[trials["speed_mps"] <= SLOW_UP_TO_MPS]
    gain = {w: compare(_gear(slow, f"{w}_long"), _gear(slow, f"{w}_short")) for w in WIDTHS}
    gain = {w: g for w, g in gain.items() if g.n}
    if not gain:
        return _unmeasured("pair of a long and a short gear at slow approaches")
    good = [w for w in gain if gain[w].low > 0]
    verdict = YES if len(good) == len(gain) else PARTLY if good else NO
    text = ", ".join(f"{w.replace('_', ' ')} {show(g)}" for w, g in gain.items())
    finding = f"Up to {SLOW_UP_TO_MPS:g} m/s, landing rate of long minus short legs: {text}."
    return verdict, finding, {f"long_minus_short_{w}_norm": g for w, g in gain.items()}


def _favoured_angles(trials: pd.DataFrame) -> Found:
    """Yes: Wide-Long lands more often at 20 to 50 than above (lower end > 0) and Narrow-Short is best at 50 to 70."""
    wide, narrow = _gear(trials, "wide_long"), _gear(trials, "narrow_short")
    if wide.empty or narrow.empty:
        return _unmeasured("Wide-Long and Narrow-Short")
    flat, steep = (wide[chosen] for chosen in (wide["angle_deg"] <= 50, wide["angle_deg"] > 50))
    if flat.empty or steep.empty:
        return _unmeasured("angles on both sides of 50 degrees")
    gain = difference(mean_rate(flat), mean_rate(steep))
    by_angle = profile(narrow, "angle_deg")
    best = by_angle.loc[by_angle["rate_norm"].idxmax()]
    parts = gain.low > 0, 50 <= best["angle_deg"] <= 70
    verdict = YES if all(parts) else PARTLY if any(parts) else NO
    finding = (
        f"Wide-Long: landing rate at 20 to 50 degrees minus that above: {show(gain)}. Narrow-Short: best at "
        f"{best['angle_deg']:g} degrees, {best['rate_norm']:.2f} ({best['low_norm']:.2f} to {best['high_norm']:.2f})."
    )
    return (
        verdict,
        finding,
        {"wide_long_flat_minus_steep_norm": gain, "narrow_short_best_deg": float(best["angle_deg"])},
    )


def _fore_legs_first(trials: pd.DataFrame) -> Found:
    """Yes: in solved trials of all gears a fore leg first in 95 % and a hind leg after it in 90 %; partly: in most."""
    good_trials = trials[solved(trials[RATE]) & (trials["n_attached"] > 0)]
    if good_trials.empty:
        return _unmeasured("solved trial")
    order = {gear: contact_order(_gear(good_trials, gear)) for gear in _gears(good_trials)}
    good = [o.fore_first.value >= 0.95 and o.swing_completed.value >= 0.9 for o in order.values()]
    most = [min(o.fore_first.low, o.swing_completed.low) > 0.5 for o in order.values()]
    verdict = YES if all(good) else PARTLY if all(most) else NO
    first = min(order, key=lambda g: order[g].fore_first.value)
    swing = min(order, key=lambda g: order[g].swing_completed.value)
    finding = (
        f"In solved trials a fore leg sticks first in {show(order[first].fore_first)} of the rollouts in the worst "
        f"gear ({model.gear_title(first)}), and a hind leg follows in {show(order[swing].swing_completed)} of those "
        f"({model.gear_title(swing)})."
    )
    return verdict, finding, {
        **{f"fore_first_{g}_norm": o.fore_first for g, o in order.items()},
        **{f"swing_completed_{g}_norm": o.swing_completed for g, o in order.items()},
    }  # fmt: skip


CLAIMS: tuple[tuple[str, Callable[[pd.DataFrame], Found]], ...] = (
    (
        "Vertical 2.5 m/s, Wide-Short: converges within about 100 rollouts to a policy near (4.6 1/s, 8.1 N mm) that "
        "lands on four legs more than 90 % of the time.",
        _convergence,
    ),
    ("In (Vx, Vz, d) successes fill one enclosed region.", _one_region),
    ("In (RREV, OF_y) successes overlap failures.", _flow_overlaps),
    ("In (RREV, OF_y, d) they separate again.", _augmented_separates),
    ("M_yd over that region is a nonlinear map.", _nonlinear_moment),
    ("High approach speed lands best, for all designs.", _fast_is_best),
    ("Long legs beat short ones at low speed.", _long_beats_short),
    ("Wide-Long favours 20 to 50 degrees; Narrow-Short peaks near 60.", _favoured_angles),
    ("Fore legs touch first, the body swings about them, the hind legs follow.", _fore_legs_first),
)
