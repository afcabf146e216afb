"""The topics of a landing: the vehicle in 3-D and every time series, for an MCAP file and for a live stream.

    /tf          foxglove.FrameTransforms  body in the world
    /ivl/pose    foxglove.PoseInFrame      the same as a pose
    /ivl/scene   foxglove.SceneUpdate      ceiling (again in each row if it moves) and body once, legs in each row
    /ivl/state   ivl.State                 every column of the trace by name, and the phase in words

Time begins at 0 with the landing; of a file with times below 0, with its first row. Messages are JSON, so that no
other library is needed to read them.
"""

import json
import math
from collections.abc import Iterator

from ivl.export import scene, schemas
from ivl.export.flight import Flight

TOPICS = {
    "/tf": schemas.FRAME_TRANSFORMS,
    "/ivl/pose": schemas.POSE_IN_FRAME,
    "/ivl/scene": schemas.SCENE_UPDATE,
    "/ivl/state": schemas.STATE,
}


def messages(flight: Flight) -> Iterator[tuple[int, str, scene.Message]]:
    """(time in ns, topic, message) in the order of time."""
    times_ns = [round(1e9 * (t - min(flight.t_s[0], 0.0))) for t in flight.t_s]  # MCAP has no time before 0
    position, attitude = flight.vector("p_WB_m", 3), flight.vector("q_WB", 4)
    feet, names = flight.feet_W_m, list(flight.columns)
    hips, radius_m = flight.hips_W_m(), flight.world.params.values["leg.foot_radius"]
    series = zip(*(column.tolist() for column in flight.columns.values()), strict=True)
    yield times_ns[0], "/ivl/scene", scene.fixed(flight, times_ns[0])
    for i, (t_ns, values) in enumerate(zip(times_ns, series, strict=True)):
        yield t_ns, "/tf", scene.transforms(t_ns, position[i], attitude[i])
        yield t_ns, "/ivl/pose", scene.pose(t_ns, position[i], attitude[i])
        if flight.world.surface.moves and i > 0:
            yield t_ns, "/ivl/scene", scene.ceiling(flight, t_ns, float(flight.t_s[i]))
        if feet is not None:
            yield t_ns, "/ivl/scene", scene.legs(t_ns, hips[i], feet[i], flight.feet_stuck[i], radius_m)
        numbers = {name: value if math.isfinite(value) else None for name, value in zip(names, values, strict=True)}
        yield t_ns, "/ivl/state", {**numbers, "phase_name": flight.phase[i]}


def encoded(message: scene.Message) -> bytes:
    """A message as it is stored or sent."""
    return json.dumps(message, separators=(",", ":"), allow_nan=False).encode()
