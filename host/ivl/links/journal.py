"""What a run folder keeps of the flights of a vehicle: a journal of all, and the recordings of those that count."""

import json
import os
import time
from pathlib import Path
from typing import Any

import numpy as np

from ivl import files, recordings
from ivl.forms import Form
from ivl.links.landing_flight import Landing, Rollout


class Journal:
    """Writes into a folder that must exist by then."""

    def __init__(self, folder: Path, form: Form) -> None:
        """Write into `folder`; theta is of `form`."""
        self._folder, self._form = folder, form

    def note(self, rollout: Rollout, what: str, landing: Landing | None = None) -> None:
        """One line of JSON per flight, on the disk before the next begins."""
        line: dict[str, Any] = {
            "time": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
            "seed": rollout.seed,
            "stream": rollout.stream,
            **dict(zip(self._form.names, rollout.theta, strict=True)),
            "what": what,
        }
        if landing is not None:
            battery_V = landing.battery_V if np.isfinite(landing.battery_V) else None
            line |= {"battery_V": battery_V, "n_legs": int(landing.outcome["n_legs"][0])}
        with (self._folder / recordings.JOURNAL).open("a", encoding="utf-8") as file:
            file.write(json.dumps(line, allow_nan=False) + "\n")
            file.flush()
            os.fsync(file.fileno())

    def keep_recording(self, landing: Landing) -> None:
        """A file named after its rollout, if there is a recording."""
        if landing.recording is None:
            return
        path = recordings.path_of(self._folder, landing.rollout.seed, landing.rollout.stream)
        path.parent.mkdir(exist_ok=True)
        files.write(path, landing.recording.to_csv())
