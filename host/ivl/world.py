"""The simulated world: one vehicle with one landing gear, and batches of rollouts in it.

    world = ivl.World(vehicle="habas2021", gear="wide_long", gear_set="as_simulated", **{"sense.latency": 0.01})
    out = world.rollouts(2.5, 90.0, np.linspace(3, 6, 100), 8.0)  # a policy: RREV_c (1/s) and M_yd (N mm)
    print((out.n_legs >= 3).mean())

A rollout is a pure function of the world, its arguments, `seed` and `stream`: the same bits alone or among a million,
on one thread or many.
"""

import math
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ivl import forms, model, native
from ivl.camera import textures
from ivl.errors import ArgumentError, ConfigError, NativeError
from ivl.outcome import as_dict, verdict
from ivl.surface import Surface
from ivl.table import Rollouts, Rows

if TYPE_CHECKING:
    import pandas as pd  # type: ignore[import-untyped]
    import xarray as xr

START_CODES = {"imparted": 0, "flown": 1, "at_trigger": 2, "state": 3}
_BATCH_ROLLOUTS = 16384  # per native call, so that Ctrl-C is answered within seconds
_SEED_MAX = 2**64 - 1
_THREADS_MAX = 256
REFUSED = "refused"
"""End of a landing that could not begin."""
CANNOT_BEGIN = "the start lies in the ceiling or behind it, or the flight core refuses the policy"
_LEVEL_OUT = "level_out"
_QUATERNION_SLACK = 4e-4
_NEVER_S = 60.0  # later than any landing ends
_HOVER_S_MAX, _HOVER_M_MAX = 600.0, 100.0

FloatArray = npt.NDArray[np.float64]
FloatLike = npt.ArrayLike


@dataclass(frozen=True)
class State:
    """A state of free flight from which a rollout starts, for example a recorded one.

    Each member is one state or many; leading axes broadcast with the other arguments of `World.rollouts`.

    Attributes:
        p_W_m: Position of the body origin in the world, shape (..., 3), m.
        v_W_mps: Velocity in the world, shape (..., 3), m/s.
        q_WB: Attitude, unit quaternion x, y, z, w, shape (..., 4).
        w_B_radps: Angular rate in body axes, shape (..., 3), rad/s.
        rotor_radps: Rotor speeds M1..M4, shape (..., 4), rad/s; None: those of a hover.
        battery_V: Open-circuit voltage of the battery, shape (...), V; None: that of the vehicle, with its scatter. A
            vehicle without a battery is given one by it.
    """

    p_W_m: npt.ArrayLike
    v_W_mps: npt.ArrayLike = (0.0, 0.0, 0.0)
    q_WB: npt.ArrayLike = (0.0, 0.0, 0.0, 1.0)
    w_B_radps: npt.ArrayLike = (0.0, 0.0, 0.0)
    rotor_radps: npt.ArrayLike | None = None
    battery_V: npt.ArrayLike | None = None

    def fields(self) -> dict[str, npt.NDArray[np.float64]]:
        """The members under the names of the library's table of specifications; vectors keep their last axis.

        Raises:
            ArgumentError: A member has another number of components, or is not a number.
        """
        given = {
            "p_start_W_m": (self.p_W_m, 3),
            "v_start_W_mps": (self.v_W_mps, 3),
            "q_start_WB": (self.q_WB, 4),
            "w_start_B_radps": (self.w_B_radps, 3),
        }
        if self.rotor_radps is not None:
            given["rotor_start_radps"] = (self.rotor_radps, 4)
        fields = {}
        for name, (value, n) in given.items():
            fields[name] = _numbers(f"state: {name}", value)
            if fields[name].shape[-1:] != (n,):
                raise ArgumentError(f"state: {name}: {n} components are needed, its shape is {fields[name].shape}")
        if self.battery_V is not None:
            fields["battery_start_V"] = _numbers("state: battery_V", self.battery_V)
        length = np.linalg.norm(fields["q_start_WB"], axis=-1)
        if not (np.abs(length - 1.0) < _QUATERNION_SLACK).all():
            bad = float(length[~(np.abs(length - 1.0) < _QUATERNION_SLACK)].flat[0])
            raise ArgumentError(f"state: q_WB: length {bad:g} (allowed 1 +- {_QUATERNION_SLACK:g}: a unit quaternion)")
        return fields


@dataclass(frozen=True)
class Trace:
    """The time series of one rollout.

    Attributes:
        rows: Record array of the library's trace table, shape (n_rows,): time, pose, velocities, thrusts, feet,
            phase, cues (`rows.fields` has units and meanings).
        outcome: The rollout's outcome record, equal to what `World.rollouts` returns for the same arguments.
    """

    rows: Rows
    outcome: np.record

    @property
    def verdict(self) -> str:
        """The outcome in words."""
        return verdict(self.outcome)

    def to_pandas(self) -> "pd.DataFrame":
        """The rows as a data frame (`ivl.table.Table.to_pandas`)."""
        return self.rows.to_pandas()

    def to_xarray(self) -> "xr.Dataset":
        """The rows as a data set over the time `t_s`; its attributes are the fields of the outcome."""
        data = self.rows.to_xarray()
        library = native.library()
        data.attrs = as_dict(self.outcome, library.end_reason(int(self.outcome["end_reason"])))
        return data

    def __repr__(self) -> str:
        """What was flown, in words."""
        return f"<trace of a landing: {self.verdict}; {len(self.rows)} rows, {float(self.rows.t_s[-1]):.3f} s>"


class World:
    """One vehicle with one landing gear under a ceiling. Immutable, may be shared by threads, can be pickled.

    Attributes:
        params: Checked parameters.
        surface: The plane that is landed on, as the library made it of them.
    """

    def __init__(
        self,
        vehicle: str = model.DEFAULT_VEHICLE,
        gear: str = model.DEFAULT_GEAR,
        gear_set: str = model.DEFAULT_GEAR_SET,
        sensing: str | None = None,
        texture: str | None = None,
        **overrides: float,
    ) -> None:
        """Read, check and assemble the files and build the native model.

        Args:
            vehicle: Name of a shipped vehicle, or a path to a YAML file.
            gear: Name of a design in the gear set.
            gear_set: Name of a shipped gear set, or a path to a YAML file.
            sensing: Name of a shipped sensor set, or a path to a YAML file; it replaces the vehicle's own sensing.
            texture: Surface that a rendered camera looks at, a name or a picture file, in place of the sensor set's.
            **overrides: Parameter values by dotted name, in the unit of the parameter table.

        Raises:
            ConfigError: A file or an override is wrong.
            NativeError: The library is missing or refuses the combination of values.
        """
        self.vehicle, self.gear, self.gear_set, self.sensing = vehicle, gear, gear_set, sensing
        self.overrides = dict(overrides)
        parts = _parts(vehicle, gear, gear_set, sensing)
        params = model.assemble(parts, overrides)
        self._build(replace(params, texture=_texture_of(params, parts[-1], texture)))

    def _build(self, params: model.Parameters) -> None:
        self.params = params
        self._library = native.library()
        try:
            self._native = self._library.create_model(params.vector())
        except NativeError as error:
            raise NativeError(f"vehicle {self.vehicle}, gear {self.gear_set}/{self.gear}: {error}") from error
        if params.values["camera.rate"] > 0.0:
            if params.texture is None:
                raise ConfigError("camera.rate: a camera needs a surface to look at: give a texture")
            self._native.give_camera(textures.make(params.texture, params.values["camera.texture_length"]))
        self.surface = Surface.of(self._native)

    def __getstate__(self) -> dict[str, Any]:
        """What pickling carries: the checked parameters, never the files' names alone nor the native handle."""
        names = ("vehicle", "gear", "gear_set", "sensing", "overrides", "params")
        return {name: getattr(self, name) for name in names}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Rebuild the native model from the pickled parameters."""
        self.__dict__.update(state)
        self._build(state["params"])

    def __repr__(self) -> str:
        """The call that makes this world."""
        extra = "".join(f", {name}={value!r}" for name, value in self.overrides.items())
        sensing = f", sensing={self.sensing!r}" if self.sensing else ""
        sensing += f", texture={self.texture!r}" if self.texture else ""
        return f"World(vehicle={self.vehicle!r}, gear={self.gear!r}, gear_set={self.gear_set!r}{sensing}{extra})"

    def changed(self, **overrides: float) -> "World":
        """The same world with parameters changed, made without reading its files again.

        Args:
            **overrides: Parameter values by dotted name, in the unit of the parameter table.

        Raises:
            ConfigError: An override is unknown or out of range.
            NativeError: The library refuses the combination of values.
        """
        values, origin = dict(self.params.values), dict(self.params.origin)
        for name, value in overrides.items():
            values[name], origin[name] = model.check_override(name, value), "override"
        world = object.__new__(World)
        world.__dict__.update({k: v for k, v in self.__dict__.items() if k not in ("params", "surface", "_native")})
        world.overrides = {**self.overrides, **overrides}
        sigma = {name: value for name, value in self.params.sigma.items() if name not in overrides}
        world._build(model.Parameters(values, origin, sigma, self.params.texture))
        return world

    @property
    def texture(self) -> str | None:
        """Surface that a rendered camera looks at, None without one."""
        return self.params.texture

    @property
    def native_model(self) -> native.NativeModel:
        """The model inside the library."""
        return self._native

    def derived(self) -> dict[str, Any]:
        """Values that the library derives once from the parameters (mass with legs, inertia, mixer ...), by name."""
        record = self._native.derived()[0]
        return {name: record[name].tolist() for name in self._library.derived_dtype.names or ()}

    def hanging_gap_m(self) -> float:
        """Distance of the body origin from the surface when it hangs on four legs at their rest angle, m."""
        p = self.params.values
        return p["leg.length"] * math.cos(math.radians(p["leg.angle"])) + p["leg.foot_radius"] - p["leg.hip_z"]

    def end_reason(self, code: int) -> str:
        """Name of an outcome's `end_reason`."""
        return self._library.end_reason(int(code))

    def phase_name(self, code: int) -> str:
        """Name of a trace row's `phase`."""
        return self._library.phase_name(int(code))

    def called_off_s(self, trace: "Trace") -> float:
        """When the policy called a flight off: the first row of its level-out, s; NaN of a flight that went on."""
        for row_s, phase in zip(trace.rows.t_s, trace.rows.phase, strict=True):
            if self.phase_name(phase) == _LEVEL_OUT:
                return float(row_s)
        return math.nan

    def rollouts(
        self,
        speed_mps: FloatLike,
        angle_deg: FloatLike,
        *theta: FloatLike,
        form: str = forms.PAPER,
        seed: npt.ArrayLike = 0,
        start: str = "imparted",
        d_ceil_m: FloatLike | None = None,
        threads: int | None = None,
        stream: npt.ArrayLike | None = None,
        state: State | None = None,
        flip_at_s: FloatLike | None = None,
        **named: FloatLike,
    ) -> Rollouts:
        """Fly one rollout for each element of the broadcast of the arguments.

        Args:
            speed_mps: Approach speed, m/s.
            angle_deg: Approach angle above the horizontal, degrees.
            *theta: The policy: one argument for each parameter of its form, in the form's order and units. For the
                paper's form: trigger threshold RREV_c (1/s), nose-up moment M_yd (N mm).
            **named: Parameters that follow those of `theta`, by the names that the form gives them.
            form: Form of the policy.
            seed: Seed of the random numbers, 0 .. 2^64 - 1.
            start: "imparted" (at the approach velocity), "flown" (from hover), "at_trigger" (moment commanded at
                once) or "state" (from the state of free flight in `state`; a threshold of 0 flips at once).
            d_ceil_m: Distance to the ceiling at the start, m; for "at_trigger" alone, which needs it.
            threads: Worker threads; omitted: all processors.
            stream: Number of the rollout within its seed; omitted: the flat index in this call.
            state: State to start from; for "state" alone, which needs it.
            flip_at_s: Time of the flip, s, in place of the threshold of the form `constant`: the first tick from then
                on that sees the ceiling come closer flips. Omitted, or 0: the policy decides.

        Returns:
            Record array of outcomes in the shape of the broadcast; fields of the library's outcome table. See
            `ivl.table.Rollouts` for data frames, units and meanings.

        Raises:
            ArgumentError: An argument is not finite, out of range, or does not broadcast.
        """
        specs, shape, given = self._specs(
            start, stream, state, form, theta, named,
            speed_mps=speed_mps, angle_deg=angle_deg, d_ceil_m=d_ceil_m, seed=seed, flip_at_s=flip_at_s,
        )  # fmt: skip
        n_threads = _check_threads(threads)
        n = math.prod(shape)
        outcomes = np.zeros(n, dtype=self._library.outcome_dtype)
        for first in range(0, n, _BATCH_ROLLOUTS):
            part = slice(first, min(first + _BATCH_ROLLOUTS, n))
            outcomes[part] = self._native.rollouts(specs(part), n_threads)
        return Rollouts.of(outcomes.reshape(shape), given)

    def trace(
        self,
        speed_mps: float,
        angle_deg: float,
        *theta: float,
        form: str = forms.PAPER,
        seed: int = 0,
        start: str = "imparted",
        d_ceil_m: float | None = None,
        stream: int = 0,
        period_s: float = 0.002,
        state: State | None = None,
        flip_at_s: float | None = None,
        **named: float,
    ) -> Trace:
        """Fly one rollout and record it every `period_s` seconds (arguments and errors as `rollouts`, scalars only)."""
        spec = self.specification(
            speed_mps, angle_deg, *theta, form=form, seed=seed, start=start, d_ceil_m=d_ceil_m, stream=stream,
            state=state, flip_at_s=flip_at_s, **named,
        )  # fmt: skip
        if not (np.isfinite(period_s) and 1e-5 <= period_s <= 1.0):
            raise ArgumentError(f"trace: period_s: value {period_s!r} is out of range (allowed 1e-05 .. 1 s)")
        rows, outcome = self._native.trace(spec, period_s)
        return Trace(rows.view(Rows), outcome.view(np.recarray)[0])

    def specification(
        self,
        speed_mps: float,
        angle_deg: float,
        *theta: float,
        form: str = forms.PAPER,
        seed: int = 0,
        start: str = "imparted",
        d_ceil_m: float | None = None,
        stream: int = 0,
        state: State | None = None,
        flip_at_s: float | None = None,
        **named: float,
    ) -> npt.NDArray[np.void]:
        """The checked record of one rollout for further calls of the library (arguments and errors as `trace`)."""
        specs, shape, _ = self._specs(
            start, stream, state, form, theta, named,
            speed_mps=speed_mps, angle_deg=angle_deg, d_ceil_m=d_ceil_m, seed=seed, flip_at_s=flip_at_s,
        )  # fmt: skip
        if shape != ():
            raise ArgumentError(f"the arguments must be scalars, they broadcast to {shape}")
        return specs(slice(0, 1))

    def approaches(
        self,
        speed_mps: FloatLike,
        angle_deg: FloatLike,
        n_rows: int,
        period_s: float = 0.01,
        seed: npt.ArrayLike = 0,
        start: str = "imparted",
        threads: int | None = None,
        stream: npt.ArrayLike | None = None,
    ) -> Rows:
        """Fly approaches that nobody ends by a flip, and record what the vehicle senses on its way to the ceiling.

        A landing with the same arguments and a flip at `flip_at_s` is the same up to that time, bit for bit.

        Args:
            speed_mps: As for `rollouts`, and so are angle_deg, seed, start, threads and stream.
            angle_deg: Likewise.
            n_rows: Most rows of an approach that are kept.
            period_s: Time between two rows, s.
            seed: Likewise.
            start: Likewise.
            threads: Likewise.
            stream: Likewise.

        Returns:
            Rows, shape (..., n_rows); those behind the first contact with the ceiling have the time NaN.
        """
        specs, shape, _ = self._specs(
            start, stream, None, forms.PAPER, (0.0, 0.0), {},
            speed_mps=speed_mps, angle_deg=angle_deg, d_ceil_m=None, seed=seed, flip_at_s=_NEVER_S,
        )  # fmt: skip
        if not (np.isfinite(period_s) and 1e-5 <= period_s <= 1.0):
            raise ArgumentError(f"approaches: period_s: value {period_s!r} is out of range (allowed 1e-05 .. 1 s)")
        n = math.prod(shape)
        rows, counts, outcomes = self._native.traces(specs(slice(0, n)), period_s, n_rows, _check_threads(threads))
        over = rows["t_s"] >= np.nan_to_num(outcomes["t_impact_s"], nan=np.inf)[:, None]
        rows["t_s"][over | (np.arange(n_rows) >= counts[:, None])] = np.nan
        return rows.reshape(*shape, n_rows).view(Rows)

    def hover(
        self,
        setpoints: npt.ArrayLike,
        duration_s: float,
        seed: npt.ArrayLike = 0,
        stream: npt.ArrayLike | None = None,
        period_s: float = 0.01,
    ) -> Rows:
        """Hover from set-point to set-point, without a landing.

        Args:
            setpoints: Time (s) from which each holds, the first from 0 on, and position (m), shape (..., n, 4). A
                flight starts at its first one, level and at rest, with rotors at hover.
            duration_s: Length of each flight, s.
            seed: Seed of the random numbers.
            stream: Number of each flight within the seed, shape (...); omitted: the flat index in this call.
            period_s: Time between two rows, s; at least a tick of the flight core.

        Returns:
            Rows of the library's trace table, shape (..., n_rows); rows after a motion that diverged have the time NaN.

        Raises:
            ArgumentError: An argument is not finite, out of range, or of the wrong shape.
        """
        points = self._setpoints(setpoints)
        tick_s = float(self._native.derived()[0]["tick_s"])
        for name, value, least, most in (
            ("duration_s", duration_s, tick_s, _HOVER_S_MAX), ("period_s", period_s, tick_s, 1.0),
        ):  # fmt: skip
            if not least * (1.0 - 1e-9) <= value <= most:
                raise ArgumentError(f"{name}: value {value!r} is out of range (allowed {least:g} .. {most:g} s)")
        shape = points.shape[:-2]
        streams = np.arange(np.prod(shape, dtype=np.int64)).reshape(shape) if stream is None else stream
        numbers = [_numbers("seed", seed), _numbers("stream", streams)]
        try:
            seeds = np.stack([np.broadcast_to(array, shape).reshape(-1) for array in numbers], axis=1)
        except ValueError as error:
            raise ArgumentError(f"seed, stream: do not broadcast to {shape}, the shape of the flights") from error
        n_rows = round(duration_s / period_s) + 1
        rows = self._native.hovers(points.reshape(-1, *points.shape[-2:]), seeds, period_s, n_rows)
        return rows.reshape(*shape, n_rows).view(Rows)

    def _setpoints(self, setpoints: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Checked set-points of hovers, shape (..., n, 4)."""
        points = _numbers("setpoints", setpoints)
        if points.ndim < 2 or points.shape[-1] != 4 or points.shape[-2] == 0:
            raise ArgumentError(f"setpoints: rows of t, x, y, z are needed, the shape is {points.shape}")
        if not (np.isfinite(points).all() and (np.abs(points) <= _HOVER_M_MAX).all()):
            raise ArgumentError(f"setpoints: all values must be finite and within +-{_HOVER_M_MAX:g}")
        if (points[..., 0, 0] != 0.0).any() or (np.diff(points[..., 0]) <= 0.0).any():
            raise ArgumentError("setpoints: the times of a flight must begin with 0 and grow")
        gap_m = self.surface.gap_m(points[..., 1:], points[..., 0])
        if not (gap_m > 0.0).all():
            raise ArgumentError(f"setpoints: all must be in front of the surface, one is {-gap_m.min():g} m behind it")
        return points

    def _specs(
        self,
        start: str,
        stream: npt.ArrayLike | None,
        state: State | None,
        form_name: str,
        theta: tuple[npt.ArrayLike, ...],
        named: Mapping[str, npt.ArrayLike],
        **arguments: npt.ArrayLike | None,
    ) -> tuple[Callable[[slice], npt.NDArray[np.void]], tuple[int, ...], dict[str, npt.NDArray[Any]]]:
        """What gives a part of the checked, broadcast and flattened specifications; the shape that all have; arguments.

        A specification has room for a long policy, so those of a large batch are not made at once.
        """
        if start not in START_CODES:
            raise ArgumentError(f"start: value {start!r} is unknown (allowed {', '.join(START_CODES)})")
        for name, value, needed in (("d_ceil_m", arguments["d_ceil_m"], "at_trigger"), ("state", state, "state")):
            if (start == needed) != (value is not None):
                raise ArgumentError(f"{name}: value {value!r}: start={needed!r} needs it, others must not have it")
        given = {
            name: _numbers(name, value)
            for name, value in arguments.items()
            if name not in ("d_ceil_m", "flip_at_s") or value is not None
        }
        if "flip_at_s" in given and form_name != forms.PAPER:
            raise ArgumentError(f"flip_at_s: only a policy of the form {forms.PAPER} is timed, not one of {form_name}")
        if stream is not None:
            given["stream"] = _numbers("stream", stream)
        given |= state.fields() if state is not None else {}
        form = forms.by_name(form_name)
        given["theta"] = self._theta(form, theta, named)
        vectors = {n for n in given if n in self._library.spec_fields and self._library.spec_fields[n].count > 1}
        shapes = {name: array.shape[:-1] if name in vectors else array.shape for name, array in given.items()}
        try:
            shape = np.broadcast_shapes(*shapes.values())
        except ValueError as error:
            told = ", ".join(f"{name} {shape}" for name, shape in shapes.items() if shape)
            raise ArgumentError(f"the arguments do not broadcast: {told}") from error
        n, flat = math.prod(shape), {}
        for name, array in given.items():
            self._check_range(name, array)
            whole = (*shape, array.shape[-1]) if name in vectors else shape
            flat[name] = np.broadcast_to(array, whole).reshape((n, *whole[len(shape) :]))

        def specs(part: slice) -> npt.NDArray[np.void]:
            records = self._library.default_specs(part.stop - part.start)
            records["start"], records["form"] = START_CODES[start], form.number
            records["stream"] = np.arange(part.start, part.stop, dtype=np.uint64)
            for name, array in flat.items():
                if name == "theta":
                    records[name][:, : form.n] = array[part]
                else:
                    records[name] = array[part]
            return records

        return specs, shape, self._told(given, form, theta, named, shape)

    @staticmethod
    def _told(
        given: Mapping[str, npt.NDArray[Any]],
        form: forms.Form,
        theta: tuple[npt.ArrayLike, ...],
        named: Mapping[str, npt.ArrayLike],
        shape: tuple[int, ...],
    ) -> dict[str, npt.NDArray[Any]]:
        """The arguments as they were given, by name: numbers of the policy in the units of their form."""
        ordered = [*theta, *(named[name] for name in form.names[len(theta) :])]
        told = {name: given[name] for name in ("speed_mps", "angle_deg", "d_ceil_m", "flip_at_s") if name in given}
        told |= {name: np.asarray(value, np.float64) for name, value in zip(form.names, ordered, strict=True)}
        stream = np.arange(math.prod(shape), dtype=np.uint64).reshape(shape)
        return told | {"seed": given["seed"], "stream": given.get("stream", stream)}

    def _theta(
        self, form: forms.Form, theta: tuple[npt.ArrayLike, ...], named: Mapping[str, npt.ArrayLike]
    ) -> FloatArray:
        """Parameters in SI units, shape (..., n)."""
        rest = form.names[len(theta) :]
        if len(theta) > form.n or set(named) != set(rest):
            given = ", ".join([f"{len(theta)} in order", *named])
            raise ArgumentError(
                f"a policy of the form {form.name} has the parameters {', '.join(form.names)}; given are {given}"
            )
        values = [*theta, *(named[name] for name in rest)]
        columns = [_numbers(name, value) for name, value in zip(form.names, values, strict=True)]
        try:
            stacked = np.stack(np.broadcast_arrays(*columns), axis=-1)
        except ValueError as error:
            shapes = ", ".join(f"{name} {column.shape}" for name, column in zip(form.names, columns, strict=True))
            raise ArgumentError(f"the arguments do not broadcast: {shapes}") from error
        return form.to_si(stacked)

    def _check_range(self, name: str, array: npt.NDArray[Any]) -> None:
        if array.dtype == np.uint64:
            return
        field = self._library.spec_fields[name]
        good = np.isfinite(array) & (array >= field.lo) & (array <= field.hi)
        if not good.all():
            value = float(array[~good].flat[0])
            raise ArgumentError(
                f"{name}: value {value!r} is out of range (allowed {field.lo:g} .. {field.hi:g} {field.unit})"
            )


def rotation(q: FloatArray) -> FloatArray:
    """Rotation matrix body to world, shape (3, 3, ...), of unit quaternions x, y, z, w, shape (4, ...)."""
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _parts(vehicle: str, gear: str, gear_set: str, sensing: str | None) -> list[model.Part]:
    """The files that make a world."""
    airframe = model.load_vehicle(vehicle)
    parts = [airframe, model.load_gear(gear, gear_set)]
    if sensing is not None:
        parts = [model.without_sensors(airframe), parts[1], model.load_sensors(sensing)]
    return parts


def _texture_of(params: model.Parameters, sensors: model.Part, texture: str | None) -> str | None:
    """The surface that the camera looks at; None where there is no camera.

    Raises:
        ConfigError: A surface is given and there is no camera.
    """
    if params.values["camera.rate"] > 0.0:
        return texture or sensors.texture
    if texture is not None:
        raise ConfigError(
            f"texture {texture!r}: {sensors.label} has no camera that looks at it (camera.rate is 0): "
            "choose a sensor set with one, such as aideck60"
        )
    return None


def _numbers(name: str, value: npt.ArrayLike | None) -> npt.NDArray[Any]:
    """The argument as a float64 array, seeds and streams as uint64."""
    array = np.asarray(value)
    if array.dtype.kind not in "iuf" or array.dtype == np.longdouble:
        raise ArgumentError(f"{name}: value {value!r} is not a number or an array of numbers")
    if name not in ("seed", "stream"):
        return array.astype(np.float64)
    if array.dtype.kind == "f" or (array.size and int(array.min()) < 0):
        raise ArgumentError(f"{name}: value {value!r} must be a whole number (allowed 0 .. {_SEED_MAX})")
    return array.astype(np.uint64)


def _check_threads(threads: int | None) -> int:
    if threads is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if isinstance(threads, bool) or not isinstance(threads, int) or not 1 <= threads <= _THREADS_MAX:
        raise ArgumentError(f"threads: value {threads!r} is out of range (allowed 1 .. {_THREADS_MAX})")
    return threads
