"""Where a run folder keeps what a vehicle recorded, and how a file is named after its rollout.

recordings/rollout-017-00f3a5c2b1d4e698.csv    rollout 17, counted from 1, of the trial with this seed
flights.jsonl                                  a line for each flight, scored or not
"""

from pathlib import Path

JOURNAL, FOLDER = "flights.jsonl", "recordings"


def name_of(seed: int, stream: int) -> str:
    """Name of the recording of a rollout, without folder and suffix."""
    return f"rollout-{stream + 1:03d}-{seed:016x}"


def path_of(run: Path, seed: int, stream: int) -> Path:
    """The recording of a rollout of a run, which need not be there."""
    return run / FOLDER / f"{name_of(seed, stream)}.csv"
