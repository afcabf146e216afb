"""Independent seeds for independent purposes, all from the one seed of a run."""

import hashlib
from enum import IntEnum

import numpy as np


class Purpose(IntEnum):
    """What a derived seed is for; the numbers are part of every stored result and never change."""

    WORLD = 1
    LEARNER = 2
    CHECK = 3
    GRID = 4
    START = 5
    SEARCH = 6
    SELECT = 7
    GO = 8
    HELD_OUT = 9
    ASSESS = 10
    FAMILY = 11
    FAMILY_ASSESS = 12
    MARGIN = 13


def derive(seed: int, purpose: Purpose) -> int:
    """A seed in 0 .. 2^63 - 1 (what SQLite's integers hold) for one purpose."""
    words = np.random.SeedSequence([seed, int(purpose)]).generate_state(1, np.uint64)
    return int(words[0] >> np.uint64(1))


def derive_from_key(seed: int, key: str) -> int:
    """A seed in 0 .. 2^63 - 1 for one of many, from its name alone: their order and number do not count."""
    digest = int.from_bytes(hashlib.sha256(key.encode()).digest())
    words = np.random.SeedSequence([seed, digest]).generate_state(1, np.uint64)
    return int(words[0] >> np.uint64(1))
