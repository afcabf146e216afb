"""What the page of a flown run shows: the recordings, each beside its simulated counterpart, which is called so."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from ivl.experiment import Experiment
from ivl.flown import Comparison, FlownLanding, compare, landings, summary
from ivl.learning.recorder import Amendment, RolloutRows
from ivl.outcome import verdict
from ivl.report.landings import Album

HEAD = (
    "rollout", "flown, as the operator says", "simulated: of 64", "simulated: one counterpart",
    "trigger at, m: recorded / simulated", "flip, ms: recorded / simulated", "pitch, deg rms", "recording", "simulated",
)  # fmt: skip


@dataclass(frozen=True)
class FlownPart:
    """The flown landings of a page.

    Attributes:
        found: Every landing that counts.
        verdicts: What the operator says of each.
        numbers: Number in the album of each rollout's recording, -1 where there is none, shape (n_rollouts,).
        counterparts: Number in the album of each landing's simulated counterpart.
        facts: Lines for the page's header.
    """

    found: Sequence[FlownLanding]
    verdicts: list[str]
    numbers: npt.NDArray[np.intp]
    counterparts: list[int]
    facts: list[list[str]]

    @classmethod
    def of(
        cls,
        folder: Path,
        experiment: Experiment,
        rollouts: RolloutRows,
        album: Album,
        on_landing: Callable[[int, int], None],
    ) -> Self:
        """Read every recording, and simulate its counterpart; both are put into the album."""
        found = landings(folder, experiment, experiment.make_world(), rollouts)
        numbers, counterparts = np.full(len(rollouts), -1), []
        for done, each in enumerate(found, 1):
            if each.recorded is not None:
                numbers[each.row] = album.show(each.spec, each.recorded, f"rollout {each.number}, as RECORDED")
            counterparts.append(album.show(each.spec, each.simulated, f"rollout {each.number}, SIMULATED counterpart"))
            on_landing(done, len(found))
        verdicts = [verdict(rollouts.outcomes[each.row]) for each in found]
        return cls(found, verdicts, numbers, counterparts, _facts(found, rollouts))

    def data(self, corrections: Sequence[Amendment]) -> dict[str, Any]:
        """The table of all landings, the recordings byte for byte, and what was corrected afterwards."""
        return {
            "head": list(HEAD),
            "rows": [self._row(i) for i in range(len(self.found))],
            "recordings": {each.path.name: each.path.read_text() for each in self.found if each.path.is_file()},
            "amendments": [asdict(made) for made in corrections],
        }

    def _row(self, i: int) -> dict[str, Any]:
        each = self.found[i]
        found = None if each.recorded is None else compare(each.recorded, each.simulated)
        cells = [str(each.number), self.verdicts[i], f"{each.forecast.n_landed} land"]
        return {
            "cells": [*cells, verdict(each.simulated.outcome), *_compared(found)],
            "recorded": int(self.numbers[each.row]),
            "simulated": self.counterparts[i],
        }


def _compared(found: Comparison | None) -> list[str]:
    """Cells: recorded / simulated."""
    if found is None:
        return ["no flip"] * 3
    flip_ms = [1e3 * value for value in found.flip_s]
    return [
        " / ".join(_number(value, 3) for value in found.d_trigger_m),
        " / ".join(_number(value, 0) for value in flip_ms),
        _number(found.pitch_rms_deg, 1),
    ]


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if np.isfinite(value) else "–"


def _facts(found: Sequence[FlownLanding], rollouts: RolloutRows) -> list[list[str]]:
    told = summary(found, rollouts)
    if not told["landings"]:
        return [["Flown", "no landing counts yet"]]
    share = f"{100 * told['rate']:.0f} %, 95 %: {100 * told['rate_lo']:.0f} .. {100 * told['rate_hi']:.0f} %"
    return [
        ["Flown: landed on three or four legs", f"{told['landed']} of {told['landings']} ({share})"],
        ["Simulated, the same policies", f"{100 * told['simulated_rate']:.0f} %"],
        ["Landings to replay", f"{told['recorded']} recordings, {told['landings']} simulated counterparts"],
    ]
