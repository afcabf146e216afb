"""What the commands print: progress and messages on stderr, results on stdout, `--json` exactly one object.

Both consoles print text as it is: no path, name or message of a user is markup. What is to look otherwise is a
`rich.text.Text`.
"""

import json
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import IO, Any, cast

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from ivl.check import Check
from ivl.forms import Form
from ivl.learning.loop import Progress

Heard = Callable[[str], None]


class _Stderr:
    """Standard error as it is at the moment, and whoever listens to it."""

    heard: Heard | None = None

    def write(self, text: str) -> int:
        """Write through."""
        if self.heard is not None:
            self.heard(text)
        return sys.stderr.write(text)

    def flush(self) -> None:
        """Flush through."""
        sys.stderr.flush()

    def isatty(self) -> bool:
        """Whether people read it."""
        return sys.stderr.isatty()

    def fileno(self) -> int:
        """Its descriptor."""
        return sys.stderr.fileno()

    @property
    def encoding(self) -> str:
        """Its encoding."""
        return sys.stderr.encoding


_STDERR = _Stderr()
_LITERAL: dict[str, Any] = {"markup": False, "emoji": False, "highlight": False, "soft_wrap": True}
out = Console(**_LITERAL)
err = Console(file=cast(IO[str], _STDERR), **_LITERAL)

_SHOWN_MAX = 4  # parameters in a line of progress
MODEL_FITS = {True: "model fits", False: "NO MODEL FITS", None: "no model"}
"""Words for `ivl.learners.base.Learner.insight`'s `model_fits`."""


@contextmanager
def overheard(heard: Heard) -> Iterator[None]:
    """Let somebody hear all that `err` prints; a line that has no end yet too."""
    before, _STDERR.heard = _STDERR.heard, heard
    try:
        yield
    finally:
        _STDERR.heard = before


def say(text: str) -> None:
    """One line for people, on stderr."""
    err.print(text)


def print_json(data: dict[str, Any]) -> None:
    """Print one JSON object on stdout, plain text whatever the terminal."""
    print(json.dumps(data, allow_nan=False))


def print_checks(found: Iterable[Check]) -> None:
    """A table of checks on stdout: PASS or FAIL, and what to do about what fails."""
    table = Table(box=None, pad_edge=False)
    for title in ("", "check", "found", "needed", "what to do"):
        table.add_column(title, overflow="fold")
    for check in found:
        mark = Text("PASS", "green") if check.ok else Text("FAIL", "bold red")
        table.add_row(mark, check.name, check.found, check.needed, "" if check.ok else check.remedy)
    out.print(table, soft_wrap=False)


def print_episode(progress: Progress, form: Form) -> None:
    """One line of live progress: episode, mu +- sigma of the first parameters, landing rate, what is expected."""
    mu = np.mean([row.mu for row in progress.rows], axis=0)
    sigma = np.mean([row.sigma for row in progress.rows], axis=0)
    policy = Text("  ").join(
        Text.assemble(f"{p.symbol} ", (f"{mu[i]:5.2f}", "bold"), f" ± {sigma[i]:4.2f} {p.unit}")
        for i, p in enumerate(form.params[:_SHOWN_MAX])
    )
    policy.append(f"  (and {form.n - _SHOWN_MAX} more)" if form.n > _SHOWN_MAX else "")
    rate = f"{100 * progress.rate_recent:3.0f} %" if np.isfinite(progress.rate_recent) else "  - "
    trials = f"  (mean of {len(progress.rows)} trials)" if len(progress.rows) > 1 else ""
    before = f"episode {progress.episode:3d}/{progress.n_episodes}  "
    expected = _expected([row.insight for row in progress.rows if row.insight is not None])
    after = f"  landing rate {rate}{expected or f'  {progress.rollouts_per_s:7.0f} rollouts/s'}{trials}"
    err.print(Text.assemble(before, policy, after))


def _expected(insights: Sequence[Mapping[str, Any]]) -> str:
    """What learners expect of their recommendations, mean over the trials; empty if none expects anything."""
    if not insights:
        return ""
    expected, margin = (np.mean([insight[name] for insight in insights]) for name in ("expected_rate", "margin_rate"))
    n_fit = sum(insight["model_fits"] for insight in insights)
    fits = f"model fits {n_fit} of {len(insights)}" if len(insights) > 1 else MODEL_FITS[bool(n_fit)]
    return f"  expected {100 * expected:3.0f} %, with margin {100 * margin:3.0f} %, {fits}"


def number(value: float | None, digits: int = 2) -> str:
    """A number for people; a dash where there is none."""
    return "-" if value is None or not np.isfinite(value) else f"{value:.{digits}f}"


def percent(value: float | None) -> str:
    """A share as a percentage; a dash where there is none."""
    return "-" if value is None or not np.isfinite(value) else f"{100 * value:.1f} %"
