"""What a learner that starts from simulated vehicles is given: the emulators of a task's family.

    simulator = Simulator.of(kin, flight, progress=print)
    belief = simulator.belief(rng, n_particles=128, trust=Trust())

The bank behind the emulators is made once and kept in the user's cache folder, under a digest of everything that it
depends on: the native library, the world, the family, the flight, the sizes and the seed. Where that folder cannot be
written, the bank is flown at each start.
"""

import hashlib
import json
import os
import zipfile
import zlib
from contextlib import suppress
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np
import scipy  # type: ignore[import-untyped]

from ivl import native
from ivl.belief import bank, emulator
from ivl.belief.bank import Bank, Progress
from ivl.belief.posterior import Belief, Trust
from ivl.belief.recording import Flight
from ivl.family import Family

MEMBERS, _FLIGHTS, _SEED = 2400, 16, 20210701


@dataclass(frozen=True)
class Simulator:
    """A family with its emulators.

    Attributes:
        kin: The family.
        flight: What is flown.
        recordings: Emulator of what a flight records.
        landings: Emulator of the landing rate.
    """

    kin: Family
    flight: Flight
    recordings: emulator.RecordingEmulator
    landings: emulator.LandingEmulator

    @staticmethod
    def of(
        kin: Family,
        flight: Flight,
        n_members: int | None = None,
        threads: int | None = None,
        progress: Progress | None = None,
    ) -> "Simulator":
        """Emulators of a family: from a cached bank, or from one that is flown now.

        Args:
            kin: The family.
            flight: What is flown.
            n_members: Members of the bank; omitted: `MEMBERS`.
            threads: Worker threads; omitted: all processors.
            progress: Called with (members flown, members), if the bank is flown.
        """
        n_members = MEMBERS if n_members is None else n_members
        path = cache_folder() / f"bank-{_digest(kin, flight, n_members)}.npz"
        flown = _cached(path)
        if flown is None:
            flown = bank.make(kin, flight, n_members, _FLIGHTS, _SEED, threads, progress)
            with suppress(OSError):  # it can be flown again
                flown.save(path)
        recordings = emulator.fit_recordings(flown, emulator.Scale.of(flown, flight.bounds))
        return Simulator(kin, flight, recordings, emulator.fit_landings(flown, recordings))

    def belief(self, rng: np.random.Generator, n_particles: int, trust: Trust) -> Belief:
        """The belief before any flight."""
        return Belief(self.recordings, self.landings, self.kin, n_particles, rng, trust)


def _cached(path: Path) -> Bank | None:
    """A bank that was kept; None if there is none that can be read."""
    try:
        return Bank.load(path)
    except (OSError, ValueError, KeyError, zipfile.BadZipFile, zlib.error):
        return None


def cache_folder() -> Path:
    """Folder of what can be made again: `$XDG_CACHE_HOME/ivl`, by default `~/.cache/ivl`."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "ivl"


def _digest(kin: Family, flight: Flight, n_members: int) -> str:
    """Of everything that a bank depends on."""
    described = {
        "version": bank.VERSION,
        "library": native.library().digest(),
        "packages": [np.__version__, scipy.__version__],
        "world": kin.world.params.digest(),
        "dimensions": [asdict(d) for d in kin.dimensions],
        "root": kin.root.tolist(),
        "scale": kin.scale,
        "flight": {f.name: np.asarray(getattr(flight, f.name)).tolist() for f in fields(flight)},
        "sizes": [n_members, _FLIGHTS, _SEED],
    }
    return hashlib.sha256(json.dumps(described, sort_keys=True).encode()).hexdigest()[:24]
