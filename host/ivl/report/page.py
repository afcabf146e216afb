"""The page itself: template, style, script, plotly and data put into one HTML file that needs no network.

Data and plotly are carried as base64 of gzip, which the browser unpacks: a page is 2 to 6 MB instead of 5 to 20. A
content security policy forbids every connection, so that the page cannot ask for anything even by mistake.
"""

import base64
import gzip
import json
import math
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from plotly.offline import get_plotlyjs  # type: ignore[import-untyped]

import ivl
from ivl.forms import Form
from ivl.learners import LEARNERS
from ivl.rewards import RewardChoice

FOLDER = Path(__file__).parent
SCRIPTS = ("data.js", "vehicle.js", "replay.js", "plots.js", "main.js")


def render(data: Mapping[str, Any]) -> str:
    """The page as HTML.

    Args:
        data: Plain data; what the scripts read of it is what `learn_page`, `sweep_page` and `policy_page` write. The
            page of a policy has its pictures ready, and no plotly.
    """
    panes = "".join(_read("pane.html").replace("{{name}}", n).replace("{{NAME}}", n.upper()) for n in "ab")
    footer = (
        f"Made by ivl {ivl.__version__} from a policy file; flights by its simulator."
        if "policy" in data
        else f"Made by ivl {ivl.__version__} from the run's own files; {_flown_words(data)} Figures: plotly.js (MIT)."
    )
    parts = {
        "style": _read("page.css"),
        "panes": panes,
        "footer": escape(footer),
        "plotly": "" if "policy" in data else _compressed(get_plotlyjs()),
        "data": _compressed(json.dumps(data, separators=(",", ":"), allow_nan=False)),
        "script": '"use strict";\n' + "\n".join(_read(name) for name in SCRIPTS),
    }
    before, *rest = _read("page.html").split("{{")
    pieces = [before]
    for part in rest:
        name, text = part.split("}}", 1)
        pieces += [parts[name], text]
    return "".join(pieces)


def _flown_words(data: Mapping[str, Any]) -> str:
    if data.get("learn", {}).get("flown"):
        return "recordings are the vehicle's, counterparts are simulated."
    return "landings flown again by its simulator."


def encode(values: npt.ArrayLike, unit: float) -> dict[str, Any]:
    """A column of the page's data: whole multiples of `unit`, None for NaN."""
    numbers = np.asarray(values, dtype=np.float64)
    whole = np.rint(numbers / unit)
    return {"unit": unit, "values": [int(value) if math.isfinite(value) else None for value in whole.tolist()]}


def fine_unit(values: npt.ArrayLike, digits: int) -> float:
    """Unit that shows the largest of some numbers with so many digits, whatever their scale; 1 if all are 0 or NaN."""
    numbers = np.abs(np.asarray(values, dtype=np.float64))
    largest = float(np.max(numbers[np.isfinite(numbers)], initial=0.0))
    return float(f"1e{math.floor(math.log10(largest)) + 1 - digits}") if largest > 0 else 1.0


def axis_from_zero(values: npt.ArrayLike) -> list[float]:
    """Range of an axis for numbers >= 0, whatever their scale."""
    numbers = np.asarray(values, dtype=np.float64)
    return [0.0, 1.06 * float(np.max(numbers[np.isfinite(numbers)], initial=0.0)) or 1.0]


def reward_names(choice: RewardChoice) -> list[list[str]]:
    """Name, unit and meaning of each term of a run's return."""
    return [[term.name, term.unit, term.doc] for term in choice.reward.terms]


def parameter_names(form: Form) -> list[list[str]]:
    """Symbol, unit and meaning of each parameter of a form."""
    return [[parameter.symbol, parameter.unit, parameter.doc] for parameter in form.params]


def learner_words(name: str) -> str:
    """A learner as the page calls it: its name, and what it is."""
    return f"{name}: {LEARNERS[name].doc.split(':')[0]}"


def flatten(data: Mapping[str, Any], prefix: str = "") -> list[list[str]]:
    """Nested data as rows of dotted name and text, for a table."""
    rows = []
    for key, value in data.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping):
            rows += flatten(value, f"{name}.")
        else:
            rows.append([name, value if isinstance(value, str) else json.dumps(value)])
    return rows


def _compressed(text: str) -> str:
    """Base64 of gzip, the same for the same text whenever it is made."""
    return base64.b64encode(gzip.compress(text.encode(), 9, mtime=0)).decode()


def _read(name: str) -> str:
    return (FOLDER / name).read_text(encoding="utf-8")
