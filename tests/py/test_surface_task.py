"""A surface as a field of the task: an angle, or more, and what becomes of it in the world."""

import json
from pathlib import Path

import numpy as np
import pytest

import ivl
from ivl import cli
from ivl.errors import NativeError
from ivl.task import Task

PLACE = ["rollout", "--speed", "2.5", "--angle", "60", "--rrev", "5", "--moment", "2", "--gear-set", "as_simulated"]
TASK = {"vehicle": "habas2021", "gear": "wide_short", "speed_mps": 2.5, "angle_deg": 60.0}
SEEN = {
    "rrev.rate": 100.0,
    "flow.rate": 100.0,
    "firmware.d_source": 2.0,
    "firmware.of_source": 1.0,
    "firmware.kf_v_sigma": 1.0,
}


@pytest.mark.parametrize(("angle", "normal"), [(180, (0, 0, 1)), (135, (1, 0, 1)), (90, (1, 0, 0)), (0, (0, 0, -1))])
def test_an_angle_says_the_normal(angle: int, normal: tuple[int, int, int]) -> None:
    surface = Task(**TASK, surface=angle).make_world().surface
    assert surface.normal_W == pytest.approx(np.array(normal) / np.linalg.norm(normal), abs=1e-12)
    assert not surface.moves
    # forward turns along with the normal, about y: on a floor it is back
    cosine = -np.cos(np.radians(angle))
    assert surface.axes_W[0] == pytest.approx([cosine, 0.0, -np.sin(np.radians(angle))], abs=1e-9)


def test_a_ceiling_is_what_is_flown_without_a_word() -> None:
    assert Task(**TASK, surface=180).make_world().params == Task(**TASK).make_world().params


def test_option_and_setting_say_the_same(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    found = []
    plot = tmp_path / "wall.png"
    for words in (["--surface", "90", "--plot", str(plot)], ["--set", "surface.angle_deg=90"]):
        assert cli.run([*PLACE, *words, "--json"]) == 0
        found.append(json.loads(capsys.readouterr().out))
    assert plot.stat().st_size > 10_000
    assert found[0] == found[1]
    assert (found[0]["n_legs"], found[0]["clean"]) == (4, True)
    # speeds are those that the wall sees: half of the speed is down, which is forward
    assert (found[0]["vx_trigger_mps"], found[0]["vz_trigger_mps"]) == pytest.approx((1.25, 2.165), abs=0.02)


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--surface", "181"], "surface.angle_deg"),
        (["--surface", "90", "--set", "surface.angle=135"], "contradicts surface"),
        (["--surface", "90", "--approach", "region"], "firmware.surface_tilt"),
        (["--set", "surface.away_mps=0.5"], "firmware.d_source 0 does not see a surface move"),
    ],
)
def test_what_cannot_be_is_refused(capsys: pytest.CaptureFixture[str], words: list[str], complaint: str) -> None:
    assert cli.run([*PLACE, *words]) != 0
    assert complaint in capsys.readouterr().err.replace("\n", " ")


@pytest.mark.parametrize("angle", [180.0, 135.0, 90.0, 45.0])
def test_left_is_right_in_a_mirror(angle: float) -> None:
    world = ivl.World("habas2021", "wide_short", "as_simulated", **{"surface.angle": angle})
    point = np.array(world.surface.point_W_m) - 0.35 * np.array(world.surface.normal_W)
    forward, normal = world.surface.axes_W[0], world.surface.axes_W[2]
    velocity = 1.25 * forward + 2.165 * normal
    left, right = (
        world.rollouts(
            2.5, 60.0, 0.0, np.linspace(1.0, 8.0, 15), start="state", seed=4, stream=0,
            state=ivl.State(p_W_m=point, v_W_mps=velocity + np.array([0.0, side, 0.0])),
        )
        for side in (0.4, -0.4)
    )  # fmt: skip
    assert left.n_legs.sum() > 15
    for name in ("n_legs", "body_contact", "end_reason", "n_ticks"):
        assert (left[name] == right[name]).all(), name
    swapped = np.array([0, 4, 3, 2, 1])[left.leg_order]
    assert (np.sort(swapped, axis=-1) == np.sort(right.leg_order, axis=-1)).all()
    for name in ("t_impact_s", "d_min_m", "vx_impact_mps", "vz_impact_mps"):
        assert left[name] == pytest.approx(right[name], abs=1e-9, nan_ok=True), name


def test_a_surface_that_moves_is_met_at_the_velocity_as_seen_from_there() -> None:
    still = ivl.World("habas2021", "wide_short", "as_simulated", **SEEN, **{"surface.angle": 90.0})
    moving = still.changed(**{"surface.speed_away": 0.5, "surface.speed_along": -0.3})
    assert moving.surface.velocity_W_mps == pytest.approx((0.5, 0.0, 0.3))
    for world in (still, moving):
        out = world.rollouts(2.5, 60.0, 6.0, 2.0)
        assert (out.vx_trigger_mps, out.vz_trigger_mps) == pytest.approx((1.25, 2.165), abs=0.15)
        assert out.n_legs == 4


def test_along_motion_needs_a_sensor_of_flow() -> None:
    with pytest.raises(NativeError, match="of_source 0 does not see it"):
        ivl.World(**{**SEEN, "firmware.of_source": 0.0, "surface.speed_along": 0.5})
