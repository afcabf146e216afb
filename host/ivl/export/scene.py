"""The vehicle as Foxglove draws it: the messages of an MCAP file for one row of a flight, and their schemas.

Frames: `world` (z up), `body` (x forward, y left, z up). Names of messages and fields are those of Foxglove's schemas.
"""

from typing import Any

import numpy as np

from ivl.export.flight import Flight, FloatArray

GREEN, GREY, DARK = (0.0, 0.62, 0.45), (0.35, 0.4, 0.45), (0.3, 0.36, 0.42)
FRONT, REAR, CEILING = (0.9, 0.62, 0.0), (0.0, 0.45, 0.7), (0.6, 0.65, 0.7)
_CEILING_SIZE_M, _CEILING_THICK_M, _LEG_THICK_M = 3.0, 0.004, 0.003

LEVEL = np.array([0.0, 0.0, 0.0, 1.0])

Message = dict[str, Any]


def stamp(t_ns: int) -> Message:
    """A time of Foxglove's schemas."""
    return {"sec": t_ns // 1_000_000_000, "nsec": t_ns % 1_000_000_000}


def transforms(t_ns: int, p_m: FloatArray, q: FloatArray) -> Message:
    """foxglove.FrameTransforms: body in the world."""
    frames = {"parent_frame_id": "world", "child_frame_id": "body"}
    return {"transforms": [{"timestamp": stamp(t_ns), **frames, "translation": _xyz(p_m), "rotation": _xyzw(q)}]}


def pose(t_ns: int, p_m: FloatArray, q: FloatArray) -> Message:
    """foxglove.PoseInFrame of the body."""
    return {"timestamp": stamp(t_ns), "frame_id": "world", "pose": {"position": _xyz(p_m), "orientation": _xyzw(q)}}


def fixed(flight: Flight, t_ns: int) -> Message:
    """foxglove.SceneUpdate with what the flight begins with: the surface, and the body in its own frame."""
    values = flight.world.params.values
    cubes = [
        _cube([0, 0, values[f"{plate}.center_z"]], [values[f"{plate}.size_{a}"] for a in "xyz"], (*colour, alpha))
        for plate, colour, alpha in (("base_plate", DARK, 1.0), ("prop_plate", CEILING, 0.25))
    ]
    radius, x, y, z = (values[f"{name}"] for name in ("aero.rotor_radius", "rotor.x", "rotor.y", "rotor.z"))
    rotors = [
        _cylinder([i * x, j * y, z], [2 * radius, 2 * radius, 0.002], (*(FRONT if i > 0 else REAR), 0.6))
        for i, j in ((1, -1), (-1, -1), (-1, 1), (1, 1))
    ]
    body = _entity(t_ns, "body", "body", cubes=cubes, cylinders=rotors)
    return {"deletions": [], "entities": [_ceiling(flight, t_ns, float(flight.t_s[0])), body]}


def ceiling(flight: Flight, t_ns: int, t_s: float) -> Message:
    """foxglove.SceneUpdate with a surface that has moved on."""
    return {"deletions": [], "entities": [_ceiling(flight, t_ns, t_s)]}


def _ceiling(flight: Flight, t_ns: int, t_s: float) -> Message:
    """A thin square in the surface, around the place where the flight ends."""
    surface = flight.world.surface
    at_end = surface.nearest_W_m(flight.vector("p_WB_m", 3)[-1], flight.t_s[-1])
    moved = surface.place_W_m(t_s) - surface.place_W_m(flight.t_s[-1])
    middle = at_end + moved + _CEILING_THICK_M / 2 * np.array(surface.normal_W)
    size = [_CEILING_SIZE_M, _CEILING_SIZE_M, _CEILING_THICK_M]
    square = {**_cube(middle, size, (*CEILING, 0.35)), "pose": _at(middle, surface.q_WS)}
    return _entity(t_ns, "ceiling", "world", cubes=[square])


def legs(t_ns: int, hips_m: FloatArray, feet_m: FloatArray, stuck: Any, radius_m: float) -> Message:
    """foxglove.SceneUpdate with the legs of one row: green where the foot is stuck.

    Args:
        t_ns: Time of the row.
        hips_m: Where the legs begin, shape (4, 3).
        feet_m: Where they end, shape (4, 3).
        stuck: Which feet are stuck, shape (4,).
        radius_m: Of the feet.
    """
    lines, spheres = [], []
    for hip, foot, is_stuck in zip(hips_m, feet_m, stuck, strict=True):
        colour = _rgba((*(GREEN if is_stuck else GREY), 1.0))
        size = 2 * max(radius_m, 0.004)
        spheres.append({"pose": _at(foot), "size": {"x": size, "y": size, "z": size}, "color": colour})
        lines.append(
            {
                "type": 0,
                "pose": _at(np.zeros(3)),
                "thickness": _LEG_THICK_M,
                "scale_invariant": False,
                "points": [_xyz(hip), _xyz(foot)],
                "color": colour,
                "colors": [],
                "indices": [],
            }
        )
    return {"deletions": [], "entities": [_entity(t_ns, "legs", "world", lines=lines, spheres=spheres)]}


def _entity(t_ns: int, name: str, frame: str, **shapes: list[Message]) -> Message:
    """An entity that stays until it is replaced, and moves along with its frame."""
    kinds = ("arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")
    head = {"timestamp": stamp(t_ns), "frame_id": frame, "id": name, "lifetime": stamp(0), "frame_locked": True}
    return {**head, "metadata": [], **{kind: shapes.get(kind, []) for kind in kinds}}


def _cube(center: Any, size: Any, colour: tuple[float, ...]) -> Message:
    return {"pose": _at(np.array(center)), "size": _xyz(np.array(size)), "color": _rgba(colour)}


def _cylinder(center: Any, size: Any, colour: tuple[float, ...]) -> Message:
    return {**_cube(center, size, colour), "bottom_scale": 1.0, "top_scale": 1.0}


def _at(point: FloatArray, q: FloatArray = LEVEL) -> Message:
    return {"position": _xyz(point), "orientation": _xyzw(q)}


def _xyz(v: FloatArray) -> Message:
    return {"x": float(v[0]), "y": float(v[1]), "z": float(v[2])}


def _xyzw(q: FloatArray) -> Message:
    return {**_xyz(q), "w": float(q[3])}


def _rgba(colour: tuple[float, ...]) -> Message:
    return dict(zip("rgba", map(float, colour), strict=True))
