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
from ivl.learners import LEARNERS

FOLDER = Path(__file__).parent
SCRIPTS = ("data.js", "vehicle.js", "replay.js", "plots.js", "main.js")


def render(data: Mapping[str, Any]) -> str:
    """The page as HTML.

    Args:
        data: Plain data; what the scripts read of it is what `learn_page` and `sweep_page` write.
    """
    panes = "".join(_read("pane.html").replace("{{name}}", n).replace("{{NAME}}", n.upper()) for n in "ab")
    footer = (
        f"Made by ivl {ivl.__version__} from the run's own files; landings flown again by its simulator. "
        "Figures: plotly.js (MIT)."
    )
    parts = {
        "style": _read("page.css"),
        "panes": panes,
        "footer": escape(footer),
        "plotly": _compressed(get_plotlyjs()),
        "data": _compressed(json.dumps(data, separators=(",", ":"), allow_nan=False)),
        "script": '"use strict";\n' + "\n".join(_read(name) for name in SCRIPTS),
    }
    before, *rest = _read("page.html").split("{{")
    pieces = [before]
    for part in rest:
        name, text = part.split("}}", 1)
        pieces += [parts[name], text]
    return "".join(pieces)


def encode(values: npt.ArrayLike, unit: float) -> dict[str, Any]:
    """A column of the page's data: whole multiples of `unit`, None for NaN."""
    numbers = np.asarray(values, dtype=np.float64)
    whole = np.rint(numbers / unit)
    return {"unit": unit, "values": [int(value) if math.isfinite(value) else None for value in whole.tolist()]}


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
