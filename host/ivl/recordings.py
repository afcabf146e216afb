"""Where a run folder keeps what a vehicle recorded, and how a file is named after its rollout.

recordings/rollout-017-00f3a5c2b1d4e698.csv    rollout 17, counted from 1, of the trial with this seed
recordings/00f3a5c2b1d4e698-16.csv             the same in earlier run folders, counted from 0; read, never written
flights.jsonl                                  a line for each flight, scored or not
"""

import re
from pathlib import Path

JOURNAL, FOLDER = "flights.jsonl", "recordings"
_NAME = re.compile(r"rollout-(\d{3,18})-([0-9a-f]{16})", re.ASCII)
_EARLIER_NAME = re.compile(r"([0-9a-f]{16})-(\d{1,18})", re.ASCII)


def path_of(run: Path, seed: int, stream: int) -> Path:
    """The recording of a rollout of a run, which need not be there."""
    path = run / FOLDER / f"rollout-{stream + 1:03d}-{seed:016x}.csv"
    earlier = run / FOLDER / f"{seed:016x}-{stream}.csv"
    return earlier if earlier.is_file() and not path.is_file() else path


def rollout_of(path: Path) -> tuple[int, int] | None:
    """Seed and stream of the rollout that a recording is named after; None if its name is of another kind."""
    if found := _NAME.fullmatch(path.stem):
        return int(found[2], 16), int(found[1]) - 1
    if found := _EARLIER_NAME.fullmatch(path.stem):
        return int(found[1], 16), int(found[2])
    return None
