"""A campaign's results as Markdown: claims, landing rates, failed trials, separability, vehicles. Numbers only."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pandas as pd  # type: ignore[import-untyped]

from ivl.analysis import region
from ivl.analysis.claims import CLAIMS, PAPER_GEAR, Claim, evaluate, show
from ivl.analysis.intervals import Estimate
from ivl.analysis.moment import explained
from ivl.analysis.policy import MOMENT, THRESHOLD, recommended
from ivl.analysis.rates import CHECK_RATE, RATE, cell_rates, compare, mean_rate, single_trial_failures
from ivl.analysis.separability import MODELS, separability

SETUP = ("vehicle", "gear_set", "learner")
PAPER_VEHICLE, DEFAULT_LEARNER = "habas2021", "bo"
_SPANS = (
    ("up to 1 m/s", 0.0, 1.0),
    ("1 to 2 m/s", 1.0, 2.0),
    ("2 to 3 m/s", 2.0, 3.0),
    ("above 3 m/s", 3.0, np.inf),
    ("all", 0.0, np.inf),
)
_SPACES = {"state": "(Vx, Vz, d)", "flow": "(RREV, OF_y)", "augmented": "(RREV, OF_y, d)"}

Setup = tuple[str, ...]


def write(trials: pd.DataFrame, states: pd.DataFrame, runs: Sequence[dict[str, Any]]) -> str:
    """The whole text.

    Args:
        trials: Table of trials of all runs; with `rollouts_to_rate`.
        states: States of policy maps (`region.map_states`), or no rows.
        runs: What identifies each run.
    """
    parts = {tuple(map(str, key)): part for key, part in trials.groupby(list(SETUP), observed=True)}
    paper = {key: part for key, part in parts.items() if key[0] == PAPER_VEHICLE}
    claims = {key: evaluate(part) for key, part in paper.items()}
    sections = (
        ("What was flown", _flown(parts, runs)),
        ("The paper's claims", _claims(claims)),
        ("Landing rates", _rates(parts)),
        ("Trials that end stuck", _stuck(parts)),
        ("Separability of success, Wide-Short", _separability(paper)),
        ("Policy maps: where a landing is possible at all", _maps(states)),
        (f"{PAPER_VEHICLE} against other vehicles", _vehicles(parts)),
    )
    return "\n\n".join(f"### {title}\n\n{text}" for title, text in sections if text)


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def name(setup: Setup) -> str:
    """A set-up in words; the vehicle only if it is not the paper's."""
    vehicle, gear_set, learner = setup
    return f"{gear_set}, `{learner}`" + ("" if vehicle == PAPER_VEHICLE else f", {vehicle}")


def _flown(parts: dict[Setup, pd.DataFrame], runs: Sequence[dict[str, Any]]) -> str:
    rows = []
    for setup, part in parts.items():
        cells = part[["gear", "speed_mps", "angle_deg"]].drop_duplicates()
        gears, speeds = part["gear"].nunique(), part["speed_mps"]
        span = (
            f"{speeds.min():g} to {speeds.max():g} m/s, {part['angle_deg'].min():g} to {part['angle_deg'].max():g} deg"
        )
        rows.append((setup[0], name(setup), str(gears), str(len(cells)), str(len(part)), span))
    text = table(("vehicle", "gear set, learner", "gears", "cells", "trials", "approaches"), rows)
    made = sorted({f"{r.get('git_commit') or 'unknown'}"[:12] for r in runs})
    libraries = sorted({str(r.get("library_sha256"))[:12] for r in runs})
    return f"{text}\n\nCommit {', '.join(made)}; simulator {', '.join(libraries)}." if runs else text


def _claims(claims: dict[Setup, list[Claim]]) -> str:
    if not claims:
        return ""
    rows = [
        (str(i + 1), CLAIMS[i][0], *(f"**{found[i].verdict}**" for found in claims.values()))
        for i in range(len(CLAIMS))
    ]
    text = table(("", "claim", *(name(setup) for setup in claims)), rows)
    for setup, found in claims.items():
        lines = [f"{c.number}. {c.verdict}: {c.finding} (`{_command(c, setup)}`)" for c in found]
        text += f"\n\n**{name(setup)}**\n\n" + "\n".join(lines)
    return text


def _command(claim: Claim, setup: Setup) -> str:
    return f"{claim.command} --set gear_set={setup[1]} --learner {setup[2]}"


def _rates(parts: dict[Setup, pd.DataFrame]) -> str:
    gears = sorted({str(g) for part in parts.values() for g in part["gear"].unique()})
    rows = []
    for gear in gears:
        cells = []
        for part in parts.values():
            own = part[part["gear"] == gear]
            best = cell_rates(own)["rate_best_norm"].mean() if len(own) else np.nan
            cells.append(f"{show(mean_rate(own))}; {best:.2f}" if len(own) else "-")
        rows.append((gear, *cells))
    return (
        "Mean over all cells of the four-leg rate in a trial's last three episodes, 95 % interval; after the semicolon "
        "the mean over cells of the best trial.\n\n" + table(("gear", *(name(setup) for setup in parts)), rows)
    )


def _stuck(parts: dict[Setup, pd.DataFrame]) -> str:
    rows = []
    for setup, part in parts.items():
        row = [name(setup), str(len(part))]
        for rate, counted in ((RATE, True), (CHECK_RATE, bool((part["n_check"] > 0).any()))):
            found = single_trial_failures(part, rate) if counted else None
            row.append(f"{found.n_failed}/{found.share.n}: {_percent(found.share)}" if found and found.share.n else "-")
        rows.append(row)
    header = ("set-up", "trials", "last three episodes", "recommended policy, fresh rollouts")
    return (
        "Share of the trials below 50 % among those of cells that some trial solved at 80 % or more, with Wilson's "
        "interval.\n\n" + table(header, rows)
    )


def _percent(share: Estimate) -> str:
    return f"{100 * share.value:.1f} % ({100 * share.low:.1f} to {100 * share.high:.1f})"


def _separability(parts: dict[Setup, pd.DataFrame]) -> str:
    chosen = {setup: part for setup, part in parts.items() if setup[-1] == DEFAULT_LEARNER} or parts
    rows = []
    for setup, part in chosen.items():
        points = region.trial_points(part[part["gear"] == PAPER_GEAR])
        if not points.empty:
            rows += _auc_rows(name(setup), points)
    if not rows:
        return ""
    return (
        "Cross-validated AUC of telling trials that land at 0.8 or more from the others, no approach in both training "
        "and test; 95 % interval over approaches.\n\n" + table(("set-up", "cues", *MODELS), rows)
    )


def _auc_rows(label: str, points: pd.DataFrame) -> list[tuple[str, ...]]:
    """One row per set of cues, one column per classifier."""
    rows = []
    for space, words in _SPACES.items():
        cues = points[list(region.CUE_SETS[space])]
        found = [separability(cues, points["success"], points["condition"], model).auc for model in MODELS]
        rows.append((label, words, *(show(auc, 3) if np.isfinite(auc.value) else "-" for auc in found)))
    return rows


def _maps(states: pd.DataFrame) -> str:
    if states.empty:
        return ""
    rows, aucs = [], []
    for (vehicle, gear_set, gear), part in states.groupby(["vehicle", "gear_set", "gear"], observed=True):
        label = f"{gear_set}, {gear}" + ("" if vehicle == PAPER_VEHICLE else f", {vehicle}")
        whole = region.components(part, ["speed_mps", "angle_deg", "d_ceil_m"])
        landing = part[part["success"]]
        widths = (landing["moment_high_Nmm"] - landing["moment_low_Nmm"]).median() if len(landing) else np.nan
        known = landing["condition"].nunique() > 1
        r2 = (
            explained(landing[list(region.AUGMENTED)], landing["moment_low_Nmm"], landing["condition"])
            if known
            else None
        )
        rows.append(
            (
                label,
                f"{whole.n_points}/{len(part)}",
                str(whole.n),
                f"{100 * whole.largest_share:.0f} %",
                str(whole.n_holes),
            )
            + ((f"{widths:.1f}", show(r2.linear), show(r2.nonlinear)) if r2 else ("-", "-", "-"))
        )
        if gear == PAPER_GEAR and len(landing):
            aucs += _auc_rows(label, part[region.near_region(part)])
    header = (
        "gear", "states that land", "parts", "in the largest", "holes", "width of the moments (N mm)",
        "R2 of the least moment: plane", "forest",
    )  # fmt: skip
    text = (
        "A state is (V, phi, d); it lands if some moment does in 80 % of the rollouts. Parts hang together on the grid "
        "of the map; holes are states that do not land and are enclosed by states that do.\n\n" + table(header, rows)
    )
    if aucs:
        text += (
            "\n\nAUC of telling states that land from near misses (RREV within the landing range widened by a quarter "
            "on either side):\n\n" + table(("gear", "cues", *MODELS), aucs)
        )
    return text


def _vehicles(parts: dict[Setup, pd.DataFrame]) -> str:
    """For each other vehicle: the same gear, gear set and learner with the paper's vehicle, by speed."""
    texts = []
    for setup, part in parts.items():
        other = parts.get((PAPER_VEHICLE, *setup[1:]))
        if setup[0] == PAPER_VEHICLE or other is None:
            continue
        for gear in sorted(map(str, part["gear"].unique())):
            texts.append(
                f"{setup[0]}, {name((PAPER_VEHICLE, *setup[1:]))}, {gear}:\n\n{_against(part, other, setup[0], gear)}"
            )
    return "\n\n".join(texts)


def _against(part: pd.DataFrame, other: pd.DataFrame, vehicle: str, gear: str) -> str:
    """One gear, two vehicles."""
    theirs, ours = part[part["gear"] == gear], other[other["gear"] == gear]
    rows = []
    for span, low, high in _SPANS:
        a, b = (frame[(frame["speed_mps"] > low) & (frame["speed_mps"] <= high)] for frame in (theirs, ours))
        if a.empty or b.empty:
            continue
        solved = [f"{(cell_rates(frame)['n_solved'] > 0).mean():.2f}" for frame in (b, a)]
        policies = [_policy(frame) for frame in (b, a)]
        rows.append((span, show(mean_rate(b)), show(mean_rate(a)), show(compare(a, b)), *solved, *policies))
    header = (
        "speed", PAPER_VEHICLE, vehicle, "difference", f"cells solved, {PAPER_VEHICLE}", vehicle,
        f"policy where solved, {PAPER_VEHICLE}", vehicle,
    )  # fmt: skip
    return table(header, rows)


def _policy(trials: pd.DataFrame) -> str:
    """Median policy of the trials that solved their cell."""
    solved = trials[trials[RATE] >= 0.8]
    if solved.empty:
        return "-"
    rrev, moment = (solved[recommended(i)].median() for i in (THRESHOLD, MOMENT))
    return f"{rrev:.2f} 1/s, {moment:.1f} N mm"
