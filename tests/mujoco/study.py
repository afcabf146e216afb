"""The figures of docs/VALIDATION.md: .venv/bin/python tests/mujoco/study.py [--landings N] [--seed N]."""

import argparse
from typing import Any

import agreement
import numpy as np
from agreement import Landing

Records = np.recarray[Any, Any]
STUDIES: tuple[tuple[str, str, dict[str, float]], ...] = (
    ("as used, same contact law", "same_law", {}),
    ("plate step 0.1 ms, same contact law", "same_law", {"step.plate": 1.0e-4}),
    ("steps / 10, same contact law", "same_law", {"step.scale": 0.1}),
    ("as used, MuJoCo's contact", "native", {}),
)


def report(title: str, landings: list[Landing], r: Records, overrides: dict[str, float]) -> None:
    """Print one study: outcomes, then percentiles of the differences."""
    differ = np.flatnonzero(r.n_legs != r.n_legs_mj)
    plate = r.plate | r.plate_mj
    print(f"\n## {title}")
    print(f"landings {len(r)}, with plate contact {plate.sum()}")
    print(f"feet stuck, 0 to 4: {np.bincount(r.n_legs, minlength=5).tolist()}")
    print(f"other number of feet: {len(differ)}, of these without plate contact {(~plate[differ]).sum()}")
    print(f"other order of sticking, same number: {((r.n_legs == r.n_legs_mj) & ~r.same_order).sum()}")
    print(f"plate contact in one engine alone: {(r.plate != r.plate_mj).sum()}")
    _percentiles("time of impact, us", 1e6 * np.abs(r.dt_impact_s))
    _percentiles("angle of impact, deg", np.abs(r.dtheta_impact_deg))
    for name, mask in (("no plate", ~plate), ("plate", plate)):
        for k, after_s in enumerate(agreement.AFTER_S):
            _percentiles(f"{name}, +{1e3 * after_s:.0f} ms, mm", 1e3 * r.dp_m[mask, k])
            _percentiles(f"{name}, +{1e3 * after_s:.0f} ms, deg", r.da_deg[mask, k])
    for i in differ:
        share = agreement.undecided(landings[i], **overrides)
        a = landings[i]
        where = f"V {a.speed_mps:.2f} phi {a.angle_deg:.0f} RREV {a.rrev_c_per_s:.2f} M {a.moment_y_Nmm:.2f}"
        contact = "no plate" if not plate[i] else "plate first" if r.plate_first[i] else "plate later"
        print(
            f"  {a.gear_set}/{a.gear} {where}: {r.n_legs[i]} against {r.n_legs_mj[i]}, {contact}, undecided {share:.2f}"
        )


def _percentiles(name: str, values: np.ndarray[Any, Any]) -> None:
    p = np.percentile(values, [50, 90, 99, 100])
    print(f"{name:28s} median {p[0]:9.4f}  90 % {p[1]:9.4f}  99 % {p[2]:9.4f}  largest {p[3]:9.4f}")


def main() -> None:
    """Draw, fly, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--landings", type=int, default=1200, help="landings that touch the ceiling")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    touching, misses = agreement.split(agreement.draw(3 * given.landings, given.seed))
    touching = touching[: given.landings]
    r = agreement.compare(misses[: given.landings // 4], "same_law")
    print(f"misses {len(r)}, of these touching in MuJoCo {r.hit_mj.sum()}")
    for title, plates, overrides in STUDIES:
        report(title, touching, agreement.compare(touching, plates, **overrides), overrides)


if __name__ == "__main__":
    main()
