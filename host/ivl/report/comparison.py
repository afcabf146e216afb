"""A page that puts runs of `ivl learn` side by side: what each has found, and how it went there.

The page is one HTML file with its pictures inside, and fits the width of a phone.
"""

import base64
import html
import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ivl import files
from ivl.api.runs import LearnRun, load
from ivl.errors import ConfigError, StoreError
from ivl.optional import needed
from ivl.outcome import FOUR_LEG_MIN
from ivl.plots import style

if TYPE_CHECKING:
    import pandas as pd  # type: ignore[import-untyped]

_STYLE = """
body { font: 16px/1.4 sans-serif; margin: 1rem auto; max-width: 60rem; padding: 0 0.8rem; color: #222; }
img { max-width: 100%; height: auto; }
div.wide { overflow-x: auto; }
table { border-collapse: collapse; }
th, td { border-bottom: 1px solid #ccc; padding: 0.25rem 0.7rem 0.25rem 0; text-align: left; vertical-align: top; }
"""
_CURVES = (("reward_mean", "mean return of an episode"), ("landing_rate_four_leg_norm", "share that lands"))


def write_comparison(folders: Sequence[Path], out: Path) -> int:
    """Write the page, and return its size in bytes.

    Args:
        folders: Run folders of `ivl learn`, two or more.
        out: HTML file to write.

    Raises:
        ConfigError: A folder is no run of `ivl learn`, is given twice, or has no finished episode.
        StoreError: The page cannot be written.
    """
    needed("pandas", "report,sweep")
    runs = [_learned(folder) for folder in folders]
    names = _names([run.folder for run in runs])
    rows = [_row(name, run) for name, run in zip(names, runs, strict=True)]
    pictures = [_picture(list(zip(names, runs, strict=True)), column, label) for column, label in _CURVES]
    text = _page(rows, pictures).encode("utf-8")
    try:
        files.write(out, text)
    except OSError as error:
        raise StoreError(f"{out}: cannot be written: {files.reason(error)}") from error
    return len(text)


def _learned(folder: Path) -> LearnRun:
    run = load(folder)
    if not isinstance(run, LearnRun):
        raise ConfigError(f"{folder}: only runs of ivl learn can be compared")
    if run.episodes().empty:
        raise ConfigError(f"{folder}: has no finished episode")
    return run


def _names(folders: Sequence[Path]) -> list[str]:
    """The shortest ends of the paths that tell the folders apart."""
    parts = [folder.resolve().parts for folder in folders]
    if len(set(parts)) < len(parts):
        raise ConfigError("report: a run is given twice")
    n = 1
    while len({each[-n:] for each in parts}) < len(parts):
        n += 1
    return ["/".join(each[-n:]) for each in parts]


def _row(name: str, run: LearnRun) -> dict[str, str]:
    """What the table says of a run."""
    trials, rollouts = run.trials(), run.rollouts()
    flown = rollouts[rollouts["status"] == "scored"]
    theta = ", ".join(f"{key} {value:.3g}" for key, value in run.recommended(int(trials["trial"].iloc[0])).items())
    judged = trials["solved"].notna()
    solved = f"{int(trials['solved'][judged].sum())} of {int(judged.sum())}" if judged.any() else "not judged"
    chosen = run.experiment
    return {
        "run": name,
        "experiment": chosen.name,
        "learner": chosen.learner.name,
        "reward": chosen.reward.name,
        "vehicle": f"{chosen.vehicle}, {chosen.gear}",
        "approach": f"{chosen.speed_mps:g} m/s, {chosen.angle_deg:g} deg",
        "rollouts flown": str(len(flown)),
        "of them landed": _percent((flown["n_legs"] >= FOUR_LEG_MIN).mean()),
        "trials solved": solved,
        "rollouts until convergence, median": _median(trials["rollouts_to_convergence"]),
        "the recommendation lands": _percent(trials["check_rate_four_leg_norm"].mean()),
        "recommendation of the first trial": theta,
    }


def _percent(share: float) -> str:
    return "not judged" if np.isnan(share) else f"{100 * share:.0f} %"


def _median(values: "pd.Series") -> str:
    known = values.dropna()
    return "none converged" if known.empty else f"{known.median():g} ({len(known)} of {len(values)} trials)"


@style.drawing
def _picture(runs: Sequence[tuple[str, LearnRun]], column: str, label: str) -> str:
    """Mean over the trials of each run, by rollouts flown, as a PNG in base64."""
    figure = style.new_figure(7.0, 3.5)
    axes = figure.subplots()
    for name, run in runs:
        grouped = run.episodes().groupby("episode")
        axes.plot(grouped["n_scored"].mean().cumsum(), grouped[column].mean(), marker=".", label=name)
    axes.set_xlabel("rollouts flown")
    axes.set_ylabel(label)
    axes.legend()
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=150)
    return base64.b64encode(stream.getvalue()).decode("ascii")


def _page(rows: Sequence[dict[str, Any]], pictures: Sequence[str]) -> str:
    """The page: one column a run, one line a fact; a fact that is the same for all is said once, above."""
    same = {key: rows[0][key] for key in rows[0] if key != "run" and len({row[key] for row in rows}) == 1}
    shared = "".join(f"<li>{html.escape(key)}: {html.escape(value)}</li>" for key, value in same.items())
    lines = []
    for key in rows[0]:
        if key not in same:
            cells = "".join(f"<td>{html.escape(row[key])}</td>" for row in rows)
            lines.append(f"<tr><th>{html.escape(key)}</th>{cells}</tr>")
    images = "".join(
        f'<p><img alt="{html.escape(label)}, by rollouts flown" src="data:image/png;base64,{picture}"></p>'
        for picture, (_, label) in zip(pictures, _CURVES, strict=True)
    )
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>Comparison of runs</title><style>{_STYLE}</style></head><body>\n"
        f"<h1>Comparison of {len(rows)} runs</h1>\n<p>The same in all of them:</p><ul>{shared}</ul>\n"
        f'<div class="wide"><table>{"".join(lines)}</table></div>\n{images}\n</body></html>\n'
    )
