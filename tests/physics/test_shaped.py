"""The shaped approach in the simulator: slow and steep approaches land once the flight core speeds them up."""

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import ivl
from ivl.outcome import clean, four_leg
from ivl.task import Task, settings_of

# R* of `polynomial2`, its moment, and always go; found by direct search in the box 1.5-3.5 m/s, 30-90 deg
POLICY = (5.082, 0.253, 1.408, -0.208, 0.379, -0.922, 9.0, 0.0, 0.0, 0.0, *[0.0] * 10)
ROOM_M = 1.5
PREDICTED = {"firmware.d_predict": 1.0}


def shaped_world(sensing: str | None = None, approach: str = "region", **overrides: float) -> ivl.World:
    task = Task(
        vehicle="habas2021", gear="wide_short", gear_set="as_simulated", sensing=sensing, approach=approach,
        speed_mps=1.0, angle_deg=60.0, start="flown",
        overrides=settings_of({"start.room": ROOM_M, **overrides}, "test"),
    )  # fmt: skip
    return task.make_world()


def approaches(n: int, speed_most_mps: float, seed: int) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    rng = np.random.default_rng(seed)
    return rng.uniform(0.25, speed_most_mps, n), rng.uniform(20.0, 90.0, n)


def fly(world: ivl.World, n: int, speed_most_mps: float = 4.0, seed: int = 71) -> Any:
    return world.rollouts(
        *approaches(n, speed_most_mps, seed), *POLICY, form="polynomial2", start="flown", seed=seed, threads=2
    )


def rates(out: Any) -> tuple[float, float]:
    return float(four_leg(out).mean()), float(clean(out).mean())


def test_slow_approaches_land_when_they_are_shaped_and_do_not_otherwise() -> None:
    shaped = rates(fly(shaped_world(**PREDICTED), 300, 1.5))
    plain = rates(fly(shaped_world(approach="accelerate_hold", **PREDICTED), 300, 1.5))
    assert min(shaped) >= 0.98
    assert plain[0] < 0.6


# the bounds are those of 300 rollouts of a rate that is one to two points better
@pytest.mark.parametrize(
    ("sensing", "landed", "cleanly"), [("mocap", 0.98, 0.97), ("camera50_delay20", 0.96, 0.93)], ids=["mocap", "camera"]
)
def test_the_whole_plane_lands_with_real_sensors(sensing: str, landed: float, cleanly: float) -> None:
    four, good = rates(fly(shaped_world(sensing), 300))
    assert four >= landed
    assert good >= cleanly


def test_velocity_at_the_trigger_is_that_of_the_region_or_the_command() -> None:
    world = shaped_world(**PREDICTED)
    speed, angle = approaches(200, 4.0, 71)
    out = fly(world, 200)
    record, _ = world.native_model.config()
    least = [float(record[name][0]) for name in ("ivl.region_vx", "ivl.region_vz")]
    asked = (
        np.maximum(speed * np.cos(np.radians(angle)), least[0]),
        np.maximum(speed * np.sin(np.radians(angle)), least[1]),
    )
    assert np.abs(out.vz_trigger_mps - asked[1]).max() < 0.25
    assert np.abs(out.vx_trigger_mps - asked[0]).max() < 0.35


def test_the_less_room_the_slower_but_never_slower_than_commanded() -> None:
    speeds = []
    for room_m in (0.3, 0.5, 0.7, 0.9, 1.2):
        out = shaped_world(**PREDICTED, **{"start.room": room_m}).rollouts(
            0.5, 90.0, *POLICY, form="polynomial2", start="flown"
        )
        assert out.triggered == 1
        speeds.append(float(out.vz_trigger_mps))
    assert (np.diff(speeds) > 0.05).all()
    assert speeds[0] > 0.5
    assert speeds[-1] == pytest.approx(2.0, abs=0.1)


def test_a_vehicle_stays_inside_its_fence() -> None:
    for fence_m in (0.25, 0.5, 1.0):
        world = shaped_world(**PREDICTED, **{"firmware.fence_x_max": fence_m})
        rows = world.trace(0.5, 90.0, *POLICY, form="polynomial2", start="flown").rows
        flip = int(np.argmax(rows.phase == 3))
        assert flip > 0
        assert rows.p_WB_m[:, 0].max() < fence_m
    # without a fence it would be faster, and further on
    free = shaped_world(**PREDICTED).trace(0.5, 90.0, *POLICY, form="polynomial2", start="flown").rows
    assert free.p_WB_m[:, 0].max() > 0.5


def test_start_room_is_the_least_distance_of_a_flown_start_only() -> None:
    plain = ivl.World("habas2021", "wide_short", "as_simulated")
    roomy = plain.changed(**{"start.room": 1.0})
    slow, fast = (0.5, 60.0, 4.8, 8.0), (3.0, 60.0, 4.8, 8.0)
    offset_m = plain.params.values["world.sensed_gap_offset"]
    first_m = [float(world.trace(*slow, start="flown").rows[0].d_ceil_m) + offset_m for world in (plain, roomy)]
    assert first_m[0] == pytest.approx(np.sin(np.radians(60.0)) * (0.25 / 8.6 + 0.5 * 0.39), abs=1e-6)
    assert first_m[1] == pytest.approx(1.0, abs=1e-9)
    # where the command needs more, and for other starts, nothing changes
    for arguments, start in ((fast, "flown"), (slow, "imparted")):
        assert plain.rollouts(*arguments, start=start).tobytes() == roomy.rollouts(*arguments, start=start).tobytes()
