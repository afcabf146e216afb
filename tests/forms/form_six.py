"""The builds with the forms of this folder, and experiments with them, short enough for tests."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
BUILDS = {
    "IVL_NATIVE_LIBRARY": ROOT / "build" / "release-tests-forms" / "libivl_sil.so",
    "IVL_NATIVE_SERVER": ROOT / "build" / "release-tests-forms" / "ivl_sil",
    "IVL_NATIVE_IMAGE": ROOT / "build" / "stm32-Os-tests-forms" / "tick_server.elf",
}

POLICY_SIX: dict[str, Any] = {
    "form": "six",
    "threshold_per_s": {"mu0": 4.8, "sigma0": 0.3, "bounds": [0.0, 7.0]},
    "threshold_vz_per_m": {"mu0": 0.0, "sigma0": 0.1, "bounds": [-1.0, 1.0]},
    "threshold_vx_per_m": {"mu0": 0.0, "sigma0": 0.1, "bounds": [-1.0, 1.0]},
    "flip_Nmm": {"mu0": 8.0, "sigma0": 1.0, "bounds": [0.0, 10.0]},
    "flip_vz_mNs": {"mu0": 0.0, "sigma0": 0.1, "bounds": [-1.0, 1.0]},
    "flip_most_Nmm": {"mu0": 9.5, "sigma0": 0.3, "bounds": [0.0, 10.0]},
}
SIX: dict[str, Any] = {
    "name": "six",
    "doc": "A short run of a form of somebody else.",
    "vehicle": "habas2021",
    "gear": "wide_short",
    "gear_set": "as_simulated",
    "speed_mps": 2.5,
    "angle_deg": 90.0,
    "policy": POLICY_SIX,
    "learner": {"name": "ephe_robust"},
    "n_rollouts": 4,
    "budget": 16,
    "check": {"n_fresh": 10, "effort": 0.02},
}


def policy_most(names: Sequence[str]) -> dict[str, Any]:
    """A policy of the form `most`, thresholds first, that lands where its search begins."""
    threshold = {"mu0": 4.8, "sigma0": 0.3, "bounds": [0.0, 7.0]}
    moment = {"mu0": 8.0, "sigma0": 1.0, "bounds": [0.0, 10.0]}
    return {"form": "most", **dict.fromkeys(names[:-1], threshold), names[-1]: moment}
