"""What a learner that starts from simulated vehicles is given: the emulators of a task's family.

    simulator = Simulator.of(kin, flight, progress=print)
    belief = simulator.belief(rng, n_particles=128, trust=Trust())

The first half of the bank behind the emulators is flown near policies that landed with other members. Emulators of that
half choose what the second half flies: policies that they expect to land with the very member, since the edge of its
landing window is what a decision needs to know.

Emulators are fitted once and kept in the user's cache folder, under a digest of everything that they depend on: the
native library, the world, the family, the flight, the sizes and the seed. Where that folder cannot be written, the bank
is flown at each start.
"""

import hashlib
import json
import os
import zipfile
import zlib
from contextlib import suppress
from dataclasses import asdict, dataclass, fields
from functools import partial
from importlib.metadata import version
from pathlib import Path

import numpy as np
import numpy.typing as npt
import scipy  # type: ignore[import-untyped]

from ivl import files, native
from ivl.belief import bank, emulator, recording
from ivl.belief.bank import Progress
from ivl.belief.emulator import LandingEmulator, RecordingEmulator
from ivl.belief.posterior import Belief, Trust
from ivl.belief.recording import Flight
from ivl.family import Family

MEMBERS, _FLIGHTS, _SEED = 2400, 16, 20210701
VERSION = 6
"""Of how emulators are made; cached ones of another version are not used."""
_CANDIDATES, _LIKELY, _LEAST = 96, 0.85, 0.02
"""Second half: policies to choose from, share of flights that are chosen, and a rate that none of them is below."""
_ROUGH_EPOCHS = 12


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
    recordings: RecordingEmulator
    landings: LandingEmulator

    @staticmethod
    def of(
        kin: Family,
        flight: Flight,
        n_members: int | None = None,
        threads: int | None = None,
        progress: Progress | None = None,
    ) -> "Simulator":
        """Emulators of a family: cached ones, or those of a bank that is flown now.

        Args:
            kin: The family.
            flight: What is flown.
            n_members: Members of the bank; omitted: `MEMBERS`.
            threads: Worker threads; omitted: all processors.
            progress: Called with (members flown, members), if the bank is flown.
        """
        n_members = MEMBERS if n_members is None else n_members
        path = cache_folder() / f"emulators-{_digest(kin, flight, n_members)}.npz"
        fitted = _cached(path)
        if fitted is None:
            fitted = _fitted(kin, flight, n_members, threads, progress)
            with suppress(OSError):  # they can be fitted again
                _save(path, *fitted)
        return Simulator(kin, flight, *fitted)

    def belief(self, rng: np.random.Generator, n_particles: int, trust: Trust) -> Belief:
        """The belief before any flight."""
        return Belief(self.recordings, self.landings, self.kin, n_particles, rng, trust)


def _fitted(
    kin: Family, flight: Flight, n_members: int, threads: int | None, progress: Progress | None
) -> tuple[RecordingEmulator, LandingEmulator]:
    """Emulators of a bank whose second half flies what those of the first half expect to land."""
    half = max(1, n_members // 2)

    def told(first: int) -> Progress | None:
        return (lambda done, _: progress(first + done, n_members)) if progress else None

    flown = bank.make(kin, flight, half, _FLIGHTS, _SEED, threads, told(0))
    rough = emulator.fit_recordings(flown, emulator.Scale.of(flown, flight.box))
    expected = emulator.fit_landings(flown, rough, epochs=_ROUGH_EPOCHS)
    policies = partial(_promising, expected, flight.box)
    flown = flown + bank.make(kin, flight, n_members - half, _FLIGHTS, _SEED + 1, threads, told(half), policies)
    recordings = emulator.fit_recordings(flown, emulator.Scale.of(flown, flight.box))
    return recordings, emulator.fit_landings(flown, recordings)


def _promising(
    landings: LandingEmulator, bounds: npt.NDArray[np.float64], z: npt.NDArray[np.float64], rng: np.random.Generator
) -> npt.NDArray[np.float64]:
    """Policies of members, shape (n, _FLIGHTS, dim): most of them as likely as they are expected to land."""
    n, lo, hi = len(z), *bounds.T
    candidates = rng.uniform(lo, hi, (n, _CANDIDATES, len(lo)))
    members = np.repeat(z, _CANDIDATES, axis=0)
    flat, unknown = candidates.reshape(len(members), -1), np.full((len(members), len(recording.CONDITIONS)), np.nan)
    weights = np.maximum(landings.rate(members, flat, unknown), _LEAST).reshape(n, _CANDIDATES).cumsum(axis=1)
    at = rng.random((n, _FLIGHTS, 1)) * weights[:, None, -1:]
    chosen = np.minimum((weights[:, None] < at).sum(axis=-1), _CANDIDATES - 1)
    any_policy = rng.random((n, _FLIGHTS)) >= _LIKELY
    chosen = np.where(any_policy, rng.integers(_CANDIDATES, size=chosen.shape), chosen)
    return np.asarray(np.take_along_axis(candidates, chosen[..., None], axis=1))


def _save(path: Path, recordings: RecordingEmulator, landings: LandingEmulator) -> None:
    """Write emulators to a file; a reader never sees half of it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with files.replacing(path) as new, new.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **emulator.arrays(recordings, landings))


def _cached(path: Path) -> tuple[RecordingEmulator, LandingEmulator] | None:
    """Emulators that were kept; None if there are none that can be read."""
    try:
        with np.load(path, allow_pickle=False) as data:
            return emulator.of_arrays(data)
    except (OSError, ValueError, KeyError, zipfile.BadZipFile, zlib.error):
        return None


def cache_folder() -> Path:
    """Folder of what can be made again: `$XDG_CACHE_HOME/ivl`, by default `~/.cache/ivl`."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "ivl"


def _digest(kin: Family, flight: Flight, n_members: int) -> str:
    """Of everything that a bank depends on."""
    described = {
        "version": VERSION,
        "library": native.library().digest(),
        "packages": [np.__version__, scipy.__version__, version("scikit-learn")],
        "world": kin.world.params.digest(),
        "dimensions": [asdict(d) for d in kin.dimensions],
        "root": kin.root.tolist(),
        "scale": kin.scale,
        "flight": {f.name: _plain(getattr(flight, f.name)) for f in fields(flight)},
        "sizes": [n_members, _FLIGHTS, _SEED],
    }
    return hashlib.sha256(json.dumps(described, sort_keys=True).encode()).hexdigest()[:24]


def _plain(value: object) -> object:
    return value.tolist() if isinstance(value, np.ndarray) else value
