"""Rerun's .rrd: the vehicle in 3-D and the time series that one looks at, with a blueprint that shows both."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ivl import files
from ivl.errors import IvlError
from ivl.export import scene
from ivl.export.flight import Flight

if TYPE_CHECKING:
    import rerun
    import rerun.blueprint

TIMELINE = "landing"
SERIES = ("pitch_deg", "rrev_per_s", "of_y_radps", "d_sensed_m", "d_ceil_m", "phase")
"""Columns that become plots, as far as the flight has them."""


def write(flight: Flight, path: Path) -> None:
    """Write a flight.

    Raises:
        IvlError: Rerun is not installed.
    """
    try:
        import rerun  # noqa: F401
    except ModuleNotFoundError as error:
        raise IvlError("rerun is not installed: pip install 'ivl[rerun]'") from error
    with files.replacing(path) as part:
        _record(flight, part)


def _record(flight: Flight, path: Path) -> None:
    import rerun as rr

    recording = rr.RecordingStream("ivl", recording_id=_identity(flight))
    recording.save(path, default_blueprint=_blueprint(flight))
    recording.send_recording_name(flight.title)
    values = flight.world.params.values
    plates = ("base_plate", "prop_plate")
    recording.log(
        "world/body/plates",
        rr.Boxes3D(
            sizes=[[values[f"{p}.size_{a}"] for a in "xyz"] for p in plates],
            centers=[[0.0, 0.0, values[f"{p}.center_z"]] for p in plates],
        ),
        static=True,
    )
    surface, times = flight.world.surface, [rr.TimeColumn(TIMELINE, duration=flight.t_s)]
    middle = surface.nearest_W_m(flight.vector("p_WB_m", 3)[-1], flight.t_s[-1])
    ceiling = rr.Boxes3D(sizes=[[1.0, 1.0, 0.002]], centers=[middle], quaternions=[surface.q_WS])
    recording.log("world/ceiling", ceiling, static=True)
    if surface.moves:
        moved = surface.place_W_m(flight.t_s) - surface.place_W_m(flight.t_s[-1])
        rr.send_columns("world/ceiling", times, rr.Transform3D.columns(translation=moved), recording=recording)
    body = rr.Transform3D.columns(translation=flight.vector("p_WB_m", 3), quaternion=flight.vector("q_WB", 4))
    rr.send_columns("world/body", times, body, recording=recording)
    for name in _series(flight):
        numbers = flight.columns[name].astype(np.float64)
        rr.send_columns(f"plots/{name}", times, rr.Scalars.columns(scalars=numbers), recording=recording)
    _log_legs(flight, recording)
    recording.flush()
    recording.disconnect()


def _identity(flight: Flight) -> str:
    """Equal for the same landing alone, so that tools which merge recordings keep different ones apart."""
    said = hashlib.sha256(json.dumps([flight.title, sorted(flight.facts.items())]).encode())
    for name in sorted(flight.columns):
        said.update(name.encode())
        said.update(np.ascontiguousarray(flight.columns[name]).tobytes())
    return said.hexdigest()[:32]


def _series(flight: Flight) -> list[str]:
    return [name for name in SERIES if name in flight.columns]


def _log_legs(flight: Flight, recording: rerun.RecordingStream) -> None:
    """Legs and feet row by row: green where a foot is stuck."""
    import rerun as rr

    feet = flight.feet_W_m
    if feet is None:
        return
    hips, stuck = flight.hips_W_m(), flight.feet_stuck
    colours = np.where(stuck[:, :, None], np.array(scene.GREEN), np.array(scene.GREY))
    for i, t_s in enumerate(flight.t_s):
        recording.set_time(TIMELINE, duration=float(t_s))
        strips = np.stack([hips[i], feet[i]], axis=1)
        recording.log("world/legs", rr.LineStrips3D(strips, colors=colours[i], radii=0.0015))
        recording.log("world/feet", rr.Points3D(feet[i], colors=colours[i], radii=0.004))


def _blueprint(flight: Flight) -> rerun.blueprint.Blueprint:
    import rerun.blueprint as rrb

    plots = [rrb.TimeSeriesView(origin=f"plots/{name}", name=name) for name in _series(flight)]
    return rrb.Blueprint(
        rrb.Horizontal(rrb.Spatial3DView(origin="world", name="landing"), rrb.Vertical(*plots), column_shares=[2, 1])
    )
