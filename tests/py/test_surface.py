"""The surface in Python: known planes, planes at random against their definition, and the library's own figures."""

import pickle
from typing import Any

import numpy as np
import pytest
from planes import NORMALS, product, shortest_turn

import ivl
from ivl import native
from ivl.errors import ArgumentError
from ivl.surface import Surface
from ivl.world import rotation


def random_surface(rng: np.random.Generator) -> Surface:
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    return Surface(tuple(rng.uniform(-5, 5, 3)), tuple(normal), tuple(rng.uniform(-2, 2, 3)))


def test_a_world_lands_on_the_level_ceiling_that_its_library_made(world: ivl.World) -> None:
    low = world.changed(**{"world.ceiling_height": 2.25})
    assert low.surface == Surface((0.0, 0.0, 2.25), (0.0, 0.0, 1.0))
    assert (low.surface.is_level, low.surface.moves) == (True, False)
    assert world.surface.point_W_m[2] == world.params.values["world.ceiling_height"]
    assert pickle.loads(pickle.dumps(low)).surface == low.surface


def test_a_level_ceiling_has_the_axes_of_the_world_to_the_last_bit(world: ivl.World) -> None:
    surface = world.surface
    assert (surface.axes_W == np.eye(3)).all()
    assert surface.q_WS.tolist() == [0.0, 0.0, 0.0, 1.0]
    rng = np.random.default_rng(1)
    p, q = rng.uniform(-3, 3, (100, 3)), rng.normal(size=(100, 4))
    height_m = surface.point_W_m[2]
    assert (surface.seen(p, 7.0) == p - [0.0, 0.0, height_m]).all()
    assert (surface.gap_m(p) == height_m - p[:, 2]).all()
    assert (surface.nearest_W_m(p) == np.column_stack([p[:, :2], np.full(100, height_m)])).all()
    assert (surface.closing_mps(p) == p[:, 2]).all()
    assert (surface.turned(q) == q).all()


def test_the_gap_is_the_distance_that_the_simulator_records(world: ivl.World) -> None:
    rows = world.trace(2.5, 60.0, 4.8, 8.0).rows
    assert world.surface.gap_m(rows.p_WB_m, rows.t_s) == pytest.approx(rows.d_ceil_m, abs=1e-12)


def test_a_slope_of_45_degrees() -> None:
    s = np.sqrt(0.5)
    slope = Surface((1.0, 0.0, 2.0), (s, 0.0, s))
    assert slope.axes_W == pytest.approx(np.array([[s, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, s]]))
    assert slope.gap_m([1.0, 7.0, 1.0]) == pytest.approx(s)
    assert slope.gap_m([2.0, 0.0, 2.0]) == pytest.approx(-s)  # behind it
    assert slope.nearest_W_m([1.0, 7.0, 1.0]) == pytest.approx([1.5, 7.0, 1.5])
    assert slope.seen([2.0, 0.5, 0.0]) == pytest.approx([3 * s, 0.5, -s])
    assert slope.closing_mps([0.0, 0.0, 2.0]) == pytest.approx(2 * s)
    assert slope.tangential_W_mps([0.0, 3.0, 2.0]) == pytest.approx([-1.0, 3.0, 1.0])
    assert slope.q_WS == pytest.approx([0.0, np.sin(np.pi / 8), 0.0, np.cos(np.pi / 8)])
    assert not slope.is_level


def test_a_wall_and_a_floor() -> None:
    wall = Surface((2.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    assert wall.axes_W == pytest.approx(np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]))
    assert wall.gap_m([0.5, 9.0, 9.0]) == pytest.approx(1.5)
    floor = Surface((0.0, 0.0, 0.0), (0.0, 0.0, -1.0))
    assert floor.axes_W == pytest.approx(np.diag([-1.0, 1.0, -1.0]))
    assert np.abs(floor.q_WS) == pytest.approx([0.0, 1.0, 0.0, 0.0])
    assert floor.closing_mps([1.0, 0.0, -3.0]) == pytest.approx(3.0)


def test_a_ceiling_that_comes_down_and_one_that_slides_away() -> None:
    falling = Surface((0.0, 0.0, 3.0), (0.0, 0.0, 1.0), (0.0, 0.0, -0.5))
    assert falling.moves
    assert falling.gap_m(np.zeros((3, 3)), [0.0, 1.0, 4.0]) == pytest.approx([3.0, 2.5, 1.0])
    assert falling.closing_mps([0.0, 0.0, 2.0]) == pytest.approx(2.5)
    assert falling.seen([1.0, 0.0, 2.0], 2.0) == pytest.approx([1.0, 0.0, 0.0])
    sliding = Surface((0.0, 0.0, 3.0), (0.0, 0.0, 1.0), (1.5, 0.0, 0.0))
    assert sliding.gap_m([0.0, 0.0, 2.0], 9.0) == pytest.approx(1.0)
    assert sliding.closing_mps([1.0, 0.0, 2.0]) == pytest.approx(2.0)
    assert sliding.tangential_W_mps([1.0, 0.0, 2.0]) == pytest.approx([-0.5, 0.0, 0.0])
    assert sliding.seen([3.0, 0.0, 3.0], 2.0) == pytest.approx([0.0, 0.0, 0.0])  # a foot that sticks rests in S


@pytest.mark.parametrize("seed", range(20))
def test_any_plane_agrees_with_its_definition(seed: int) -> None:
    rng = np.random.default_rng(seed)
    surface = random_surface(rng)
    p, v, q = rng.uniform(-5, 5, (50, 3)), rng.uniform(-3, 3, (50, 3)), rng.normal(size=(50, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    t, dt = rng.uniform(0, 3, 50), 1e-6
    axes, normal = surface.axes_W, np.array(surface.normal_W)
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert axes[2] == pytest.approx(normal)
    assert rotation(surface.q_WS) == pytest.approx(axes.T, abs=1e-12)
    # forward is x, turned the shortest way from z to the normal
    assert axes == pytest.approx(rotation(shortest_turn(normal)).T, abs=1e-9)
    gap, nearest = surface.gap_m(p, t), surface.nearest_W_m(p, t)
    assert nearest - p == pytest.approx(gap[:, None] * normal, abs=1e-12)
    assert surface.gap_m(nearest, t) == pytest.approx(np.zeros(50), abs=1e-12)
    assert surface.seen(p, t)[:, 2] == pytest.approx(-gap)
    assert np.linalg.norm(surface.seen(p, t), axis=1) == pytest.approx(np.linalg.norm(p - surface.place_W_m(t), axis=1))
    assert (gap - surface.gap_m(p + v * dt, t + dt)) / dt == pytest.approx(surface.closing_mps(v), abs=1e-6)
    moved = (surface.seen(p + v * dt, t + dt) - surface.seen(p, t)) / dt
    along = surface.tangential_W_mps(v) @ axes.T
    assert moved[:, :2] == pytest.approx(along[:, :2], abs=1e-6)
    assert along[:, 2] == pytest.approx(np.zeros(50), abs=1e-12)
    assert rotation(surface.turned(q).T) == pytest.approx(np.einsum("ij,jkn->ikn", axes, rotation(q.T)), abs=1e-12)
    assert product(surface.q_WS, surface.turned(q)) == pytest.approx(q, abs=1e-12)


@pytest.mark.parametrize("angle_rad", [np.pi - 1e-3, np.pi - 1e-6, np.pi - 1e-7, np.pi / 2, 1e-8])
def test_axes_stay_axes_next_to_a_floor(angle_rad: float) -> None:
    for turn in np.linspace(0, 2 * np.pi, 7):
        sine = np.sin(angle_rad)
        normal = np.array([sine * np.cos(turn), sine * np.sin(turn), np.cos(angle_rad)])
        surface = Surface((0.0, 0.0, 1.0), tuple(normal / np.linalg.norm(normal)))
        assert surface.axes_W @ surface.axes_W.T == pytest.approx(np.eye(3), abs=1e-6)
        assert np.linalg.norm(surface.q_WS) == pytest.approx(1.0)
        assert rotation(surface.q_WS) == pytest.approx(surface.axes_W.T, abs=1e-6)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (((0.0, 0.0, 3.0), (0.0, 0.0, 2.0)), "normal_W: length 2 "),
        (((0.0, 0.0, 3.0), (0.0, 0.0, 0.0)), "normal_W: length 0 "),
        (((0.0, 0.0, 3.0), (0.0, 0.0, np.nan)), "normal_W: .* three finite numbers"),
        (((0.0, 3.0), (0.0, 0.0, 1.0)), "point_W_m: .* three finite numbers"),
        (((0.0, 0.0, 3.0), (0.0, 0.0, 1.0), (0.0, np.inf, 0.0)), "velocity_W_mps: .* three finite numbers"),
    ],
)
def test_what_is_no_plane_is_refused(arguments: Any, words: str) -> None:
    with pytest.raises(ArgumentError, match=words):
        Surface(*arguments)


def test_the_fields_are_those_of_the_library() -> None:
    library = native.library()
    assert list(library.surface_fields) == list(Surface.__dataclass_fields__)
    assert library.surface_dtype.itemsize == 9 * 8


def test_a_hover_stays_in_front_of_the_surface_wherever_that_is(world: ivl.World) -> None:
    sloped = world.changed()
    sloped.surface = Surface((1.0, 0.0, 1.0), NORMALS["slope"])  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="in front of the surface"):
        sloped.hover([[0.0, 2.0, 0.0, 1.0]], 0.1)
    assert len(sloped.hover([[0.0, 0.0, 0.0, 1.0]], 0.1)) > 0
    sloped.surface = Surface((0.0, 0.0, 3.0), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0))
    with pytest.raises(ArgumentError, match=r"in front of the surface, one is 0\.5 m behind it"):
        sloped.hover([[0.0, 0.0, 0.0, 1.0], [2.5, 0.0, 0.0, 1.0]], 3.0)
