"""The native simulator, loaded with ctypes; every name, unit, range and offset comes from the library's own tables.

Nothing about a structure is typed here a second time: `ivl_sil_table()` describes each record field by field, and
numpy dtypes are built from that. The calls release the interpreter lock while they run.
"""

import ctypes
import hashlib
import itertools
import os
import weakref
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ivl.errors import NativeError

ABI_VERSION = 3
LIBRARY_ENV = "IVL_NATIVE_LIBRARY"  # another build of the library, for example one with sanitizers
REGISTER_BITS_ENV = "IVL_REGISTER_BITS"  # width of the registers in which rollouts stand side by side
DEFAULT_LIBRARY = Path(__file__).parent / "_native" / "libivl_sil.so"

TABLE_PARAM, TABLE_SPEC, TABLE_OUTCOME, TABLE_TRACE, TABLE_DERIVED = range(5)
TABLE_REPLAY_IN, TABLE_REPLAY_OUT, TABLE_SURFACE = range(5, 8)
LAYOUT_RECORD_HEADER, LAYOUT_RECORD_ROW, LAYOUT_CONFIG, LAYOUT_LOGS = range(0x100, 0x104)
_ERROR_BYTES = 256
_TRACE_ROWS = 1024  # first guess; the call says when it needs more
_REFUSED = ("", "configuration", "policy")  # ivl_sim_replay_status_t
_FIELD_TYPES = {"f8": 8, "f4": 4, "i4": 4, "u4": 4, "u8": 8, "i8": 8, "i2": 2, "u2": 2, "i1": 1, "u1": 1}


@dataclass(frozen=True)
class Field:
    """One line of a table of the library.

    Attributes:
        name: Field name; dotted for parameters ("body.mass").
        type: numpy type code of one element.
        offset: Bytes from the start of the record.
        count: Number of elements (1: scalar).
        unit: Unit of the stored value, "1" if dimensionless.
        lo: Smallest allowed value.
        hi: Largest allowed value.
        default: Value if not given, None if it must be given.
        doc: One line of documentation.
    """

    name: str
    type: str
    offset: int
    count: int
    unit: str
    lo: float
    hi: float
    default: float | None
    doc: str


class _CField(ctypes.Structure):
    _fields_ = [
        ("name", ctypes.c_char_p),
        ("type", ctypes.c_char_p),
        ("offset", ctypes.c_uint32),
        ("count", ctypes.c_uint32),
        ("unit", ctypes.c_char_p),
        ("lo", ctypes.c_double),
        ("hi", ctypes.c_double),
        ("dflt", ctypes.c_double),
        ("doc", ctypes.c_char_p),
    ]


class NativeLibrary:
    """One loaded library: its tables as `Field`s and numpy dtypes, and its calls as methods."""

    def __init__(self, path: Path) -> None:
        """Load the library at `path`.

        Raises:
            NativeError: The file is missing, cannot be loaded, or speaks another version of the interface.
        """
        if not path.is_file():
            raise NativeError(f"{path}: the native library is missing: run `make build`")
        try:
            self._c = ctypes.CDLL(str(path))
            _declare(self._c)
        except (OSError, AttributeError) as error:
            raise NativeError(f"{path}: cannot be loaded ({error}): run `make build`") from error
        version = int(self._c.ivl_sil_abi_version())
        if version != ABI_VERSION:
            raise NativeError(
                f"{path}: interface version {version}, this package needs {ABI_VERSION}: run `make build`"
            )
        self.path = path
        if asked := os.environ.get(REGISTER_BITS_ENV):
            self.use_registers(asked)
        self.params: Mapping[str, Field] = {f.name: f for f in self._fields(TABLE_PARAM)[0]}
        self.spec_fields, self.spec_dtype = self._table(TABLE_SPEC)
        self.outcome_fields, self.outcome_dtype = self._table(TABLE_OUTCOME)
        self.trace_fields, self.trace_dtype = self._table(TABLE_TRACE)
        self.derived_fields, self.derived_dtype = self._table(TABLE_DERIVED)
        self.replay_in_fields, self.replay_in_dtype = self._table(TABLE_REPLAY_IN)
        self.replay_out_fields, self.replay_out_dtype = self._table(TABLE_REPLAY_OUT)
        self.surface_fields, self.surface_dtype = self._table(TABLE_SURFACE)

    def _fields(self, table: int, call: str = "ivl_sil_table") -> tuple[tuple[Field, ...], int]:
        n_fields, item_size = ctypes.c_uint32(), ctypes.c_uint32()
        rows = getattr(self._c, call)(table, ctypes.byref(n_fields), ctypes.byref(item_size))
        if not rows:
            raise NativeError(f"{self.path}: table {table} is missing")
        return tuple(_field(rows[i]) for i in range(n_fields.value)), item_size.value

    def _table(self, table: int) -> tuple[Mapping[str, Field], np.dtype[np.void]]:
        fields, item_size = self._fields(table)
        return {f.name: f for f in fields}, _dtype(fields, item_size)

    def layout(self, code: int) -> tuple[Mapping[str, Field], np.dtype[np.void]]:
        """Fields of a packet of the app channel, by its type, or of a record of the vehicle (`LAYOUT_...`)."""
        fields, item_size = self._fields(code, "ivl_sil_layout")
        return {f.name: f for f in fields}, _dtype(fields if item_size else (), item_size)

    def table_of(self, call: str) -> tuple[Mapping[str, Field], np.dtype[np.void]]:
        """Fields of a record that a part of the library has a table of its own for."""
        function = getattr(self._c, call)
        function.restype = ctypes.POINTER(_CField)
        n_fields, item_size = ctypes.c_uint32(), ctypes.c_uint32()
        rows = function(ctypes.byref(n_fields), ctypes.byref(item_size))
        fields = tuple(_field(rows[i]) for i in range(n_fields.value))
        return {f.name: f for f in fields}, _dtype(fields, item_size.value)

    def use_registers(self, bits: int | str = 0) -> int:
        """Choose the width of the registers in which rollouts stand side by side; outcomes do not depend on it.

        Args:
            bits: 128, 256 or 512; 0: the widest that this machine has.

        Returns:
            The width in use from now on, in every thread.

        Raises:
            NativeError: This machine has no such registers; nothing is changed.
        """
        width = int(self._c.ivl_sil_register_bits(int(bits))) if str(bits).isdecimal() else 0
        if width == 0:
            raise NativeError(
                f"no registers of {bits} bits here (128, 256 or 512, if the machine has them; 0: the widest)"
            )
        return width

    def register_bits(self) -> int:
        """Width of the registers in use."""
        return int(self._c.ivl_sil_register_bits(-1))

    def wire_version(self) -> int:
        """Version that the second byte of each packet of the app channel has."""
        return int(self._c.ivl_sil_wire_version())

    @property
    def c(self) -> Any:
        """The library itself, for modules that declare further functions of it."""
        return self._c

    def digest(self) -> str:
        """SHA-256 of the library file: two runs are only comparable bit for bit if it is the same."""
        return hashlib.sha256(self.path.read_bytes()).hexdigest()

    def default_specs(self, n: int) -> npt.NDArray[np.void]:
        """Rollout specifications with every field at its default, those without one at zero; shape (n,)."""
        specs = np.zeros(n, dtype=self.spec_dtype)
        for name, field in self.spec_fields.items():
            if field.default is not None:
                specs[name] = field.default
        return specs

    def create_model(self, values: npt.NDArray[np.float64]) -> "NativeModel":
        """Build a native model from the parameter vector (order of `params`)."""
        return NativeModel(self, values)

    def forms(self) -> list[tuple[str, str, tuple[tuple[str, Field], ...]]]:
        """Forms by number: name, description, parameters with symbol (range in SI; `default`: one unit in SI)."""
        found: list[tuple[str, str, tuple[tuple[str, Field], ...]]] = []
        name, doc = ctypes.c_char_p(), ctypes.c_char_p()
        while self._c.ivl_sil_form(len(found), ctypes.byref(name), ctypes.byref(doc)):
            found.append((_text(name), _text(doc), tuple(self._form_parameters(len(found)))))
        return found

    def _form_parameters(self, number: int) -> Iterator[tuple[str, Field]]:
        row, symbols = _CField(), ctypes.c_char_p()
        for g in itertools.count():
            if self._c.ivl_sil_form_group(number, g, ctypes.byref(row), ctypes.byref(symbols)):
                return
            group = _field(row)
            names, letters = group.name.split(" "), _text(symbols).split(" ")
            if not len(names) == len(letters) == group.count:
                raise NativeError(f"{self.path}: policy form {number}: {group.count} parameters are not named {names}")
            for name, symbol in zip(names, letters, strict=True):
                yield symbol, replace(group, name=name, count=1)

    def policy_crc(self, form: int, theta_si: npt.NDArray[np.float64]) -> int:
        """Checksum of a policy: number of its form, and its parameters in SI units."""
        theta = self.theta(theta_si)
        return int(self._c.ivl_sil_policy_crc(form, _pointer(theta)))

    def decide(
        self, form: int, theta_si: npt.NDArray[np.float64], seen: npt.NDArray[np.float64]
    ) -> npt.NDArray[np.float64]:
        """What a policy decides, as the flight core does it.

        Args:
            form: Number of its form.
            theta_si: Its parameters in SI units.
            seen: Distance to the ceiling (m), RREV (1/s) and OF_y (rad/s), shape (n, 3).

        Returns:
            1 to flip, 1 to go, moment of the flip (N m) and probability of a landing, shape (n, 4).
        """
        theta, seen = self.theta(theta_si), np.ascontiguousarray(seen, dtype=np.float64)
        actions = np.zeros((len(seen), 4))
        self._c.ivl_sil_policy_decide(form, _pointer(theta), _pointer(seen), len(seen), _pointer(actions))
        return actions

    def theta(self, theta_si: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Parameters with zeros behind them, as many as the library takes."""
        theta = np.zeros(self.spec_fields["theta"].count)
        theta[: theta_si.size] = theta_si
        return theta

    def surface_forward(self, surface: npt.NDArray[np.void]) -> npt.NDArray[np.float64]:
        """Unit vector along a surface (one record of `surface_dtype`) that is forward, in the world."""
        forward = np.zeros(3)
        self._c.ivl_sil_surface_forward(_pointer(surface), _pointer(forward))
        return forward

    def end_reason(self, code: int) -> str:
        """Name of an outcome's `end_reason`."""
        return bytes(self._c.ivl_sil_end_reason(code)).decode()

    def phase_name(self, code: int) -> str:
        """Name of a trace row's `phase`."""
        return bytes(self._c.ivl_sil_phase_name(code)).decode()

    def rule_name(self, code: int) -> str:
        """Name of a safety rule of the flight core."""
        return bytes(self._c.ivl_sil_rule_name(code)).decode()

    def rules(self) -> Mapping[str, bool]:
        """Safety rules of the flight core by number; true: a flight that it ended says nothing about its policy."""
        discards = self._c.ivl_sil_rule_discards
        codes = itertools.takewhile(lambda code: discards(code) >= 0, itertools.count())
        return {self.rule_name(code): bool(discards(code)) for code in codes}


class NativeModel:
    """A vehicle and a gear inside the library; immutable, may be used from several threads at once."""

    def __init__(self, library: NativeLibrary, values: npt.NDArray[np.float64]) -> None:
        """Create the model; the library frees it with this object.

        Raises:
            NativeError: The library refused the parameters; its message says which.
        """
        if values.shape != (len(library.params),):
            raise NativeError(
                f"the parameter vector has shape {values.shape}, the library needs ({len(library.params)},)"
            )
        vector = np.ascontiguousarray(values, dtype=np.float64)
        message = ctypes.create_string_buffer(_ERROR_BYTES)
        handle = library._c.ivl_sil_model_create(_pointer(vector), message, _ERROR_BYTES)
        if not handle:
            raise NativeError(message.value.decode())
        self._library = library
        self._handle = ctypes.c_void_p(handle)
        weakref.finalize(self, library._c.ivl_sil_model_free, self._handle)

    @property
    def handle(self) -> ctypes.c_void_p:
        """The library's model, for its further functions."""
        return self._handle

    def derived(self) -> npt.NDArray[np.void]:
        """Quantities that the library derives once from the parameters, one record of `derived_dtype`."""
        record = np.zeros(1, dtype=self._library.derived_dtype)
        self._library._c.ivl_sil_model_derived(self._handle, _pointer(record))
        return record

    def surface(self) -> npt.NDArray[np.void]:
        """The plane that is landed on, one record of `surface_dtype`."""
        record = np.zeros(1, dtype=self._library.surface_dtype)
        self._library._c.ivl_sil_model_surface(self._handle, _pointer(record))
        return record

    def give_camera(self, texture: Any) -> None:
        """Give the camera of `camera.rate` a surface to look at (`ivl.camera.native.Texture`); once.

        Raises:
            NativeError: The estimator refuses the camera, or there is no memory.
        """
        result = int(self._library._c.ivl_sil_model_camera(self._handle, texture.handle))
        if result:
            raise NativeError(("the estimator refuses this camera", "there is not enough memory")[result - 1])
        weakref.finalize(self, _keep, texture)

    def film(
        self,
        spec: npt.NDArray[np.void],
        capacity: int,
        row_doubles: int,
        reading: np.dtype[np.void],
        shape: tuple[int, int] | None,
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.void], npt.NDArray[np.uint8] | None, npt.NDArray[np.void]]:
        """Fly one spec and keep what its camera saw: rows of the motion, readings, pictures, outcome of shape (1,).

        Args:
            spec: One record of `spec_dtype`.
            capacity: Most pictures that are kept.
            row_doubles: Numbers of a row.
            reading: Record of a reading.
            shape: Rows and columns of a picture; None: the pictures are not kept.

        Raises:
            NativeError: There is no camera, no memory, or there are more pictures.
        """
        outcome = np.zeros(1, dtype=self._library.outcome_dtype)
        rows, readings = np.zeros((capacity, row_doubles)), np.zeros(capacity, dtype=reading)
        grey = None if shape is None else np.zeros((capacity, *shape), dtype=np.uint8)
        n = int(
            self._library._c.ivl_sil_camera_film(
                self._handle, _pointer(spec), capacity, _pointer(rows), _pointer(readings),
                None if grey is None else _pointer(grey), _pointer(outcome),
            )
        )  # fmt: skip
        if not 0 <= n <= capacity:
            raise NativeError(f"the film of a landing has {n} pictures, not 0 .. {capacity}: no camera, or no memory")
        return rows[:n], readings[:n], None if grey is None else grey[:n], outcome

    def config(self) -> tuple[npt.NDArray[np.void], int]:
        """The flight core's configuration, one record of the layout `LAYOUT_CONFIG`, and its CRC-32."""
        record = np.zeros(1, dtype=self._library.layout(LAYOUT_CONFIG)[1])
        crc = self._library._c.ivl_sil_model_config(self._handle, _pointer(record))
        return record, int(crc)

    def accepts(self, form: int, theta_si: npt.NDArray[np.float64]) -> bool:
        """Whether a flight core with this configuration puts a policy in force: form and parameters in SI units."""
        theta = self._library.theta(theta_si)
        return bool(self._library._c.ivl_sil_policy_accepted(self._handle, form, _pointer(theta)))

    def replay(
        self,
        config: npt.NDArray[np.void],
        policy: tuple[int, npt.NDArray[np.float64]],
        inputs: npt.NDArray[np.void],
    ) -> tuple[npt.NDArray[np.void], str]:
        """Step a fresh flight core through recorded inputs, where this model's core runs.

        Args:
            config: Configuration, one record as `config()` gives it.
            policy: Number of its form, and its parameters in SI units.
            inputs: One record of `replay_in_dtype` a tick.

        Returns:
            One record of `replay_out_dtype` a tick, and "" or what the core refused: "configuration" or "policy".
        """
        inputs = np.ascontiguousarray(inputs)
        rows = np.zeros(inputs.shape, dtype=self._library.replay_out_dtype)
        call = self._library._c.ivl_sil_replay
        form, theta = policy[0], self._library.theta(policy[1])
        status = int(
            call(self._handle, _pointer(config), form, _pointer(theta), _pointer(inputs), inputs.size, _pointer(rows))
        )
        return rows, _REFUSED[status]

    def rollouts(self, specs: npt.NDArray[np.void], n_threads: int) -> npt.NDArray[np.void]:
        """Fly `specs` (1-D, `spec_dtype`); returns the outcomes in the same order, same bits for any `n_threads`."""
        return self.rollouts_and_occupancy(specs, n_threads)[0]

    def rollouts_and_occupancy(self, specs: npt.NDArray[np.void], n_threads: int) -> tuple[npt.NDArray[np.void], float]:
        """The same, and the share of the lanes' evaluations that the landings asked for."""
        work = np.zeros(2, dtype=np.uint64)
        outcomes = np.zeros(specs.shape, dtype=self._library.outcome_dtype)
        status = self._library._c.ivl_sil_rollouts(
            self._handle, _pointer(specs), specs.size, n_threads, _pointer(outcomes), _pointer(work)
        )
        if status != 0:
            raise NativeError(f"the native batch of {specs.size} rollouts failed with status {status}")
        return outcomes, float(work[1]) / float(work[0]) if work[0] else 1.0

    def trace(self, spec: npt.NDArray[np.void], period_s: float) -> tuple[npt.NDArray[np.void], npt.NDArray[np.void]]:
        """Fly one spec and record it every `period_s`; returns (rows, outcome of shape (1,))."""
        outcome = np.zeros(1, dtype=self._library.outcome_dtype)
        rows = np.zeros(_TRACE_ROWS, dtype=self._library.trace_dtype)
        for _ in range(2):
            n_rows = self._trace_into(spec, period_s, rows, outcome)
            if n_rows <= rows.size:
                return rows[:n_rows], outcome
            rows = np.zeros(n_rows, dtype=self._library.trace_dtype)
        raise NativeError(f"the trace needs {n_rows} rows after {rows.size} had been promised")

    def traces(
        self, specs: npt.NDArray[np.void], period_s: float, n_rows: int, n_threads: int
    ) -> tuple[npt.NDArray[np.void], npt.NDArray[np.uint64], npt.NDArray[np.void]]:
        """Fly `specs` (1-D) and record each every `period_s`.

        Returns:
            Rows, shape (n, n_rows), zero behind the end of a landing; rows that each landing has, which may be more;
            outcomes, shape (n,).
        """
        outcomes = np.zeros(specs.shape, dtype=self._library.outcome_dtype)
        rows = np.zeros((specs.size, n_rows), dtype=self._library.trace_dtype)
        counts = np.zeros(specs.size, dtype=np.uint64)
        call = self._library._c.ivl_sil_traces
        status = call(
            self._handle, _pointer(specs), specs.size, n_threads, period_s, _pointer(rows), n_rows, _pointer(counts),
            _pointer(outcomes),
        )  # fmt: skip
        if status != 0:
            raise NativeError(f"the native batch of {specs.size} traces failed with status {status}")
        return rows, counts, outcomes

    def _trace_into(
        self, spec: npt.NDArray[np.void], period_s: float, rows: npt.NDArray[np.void], outcome: npt.NDArray[np.void]
    ) -> int:
        call = self._library._c.ivl_sil_trace
        n_rows = int(call(self._handle, _pointer(spec), period_s, _pointer(rows), rows.size, _pointer(outcome)))
        if n_rows < 0:
            raise NativeError(f"the native trace failed with status {n_rows}")
        return n_rows

    def hovers(
        self,
        setpoints: npt.NDArray[np.float64],
        seeds: npt.NDArray[np.uint64],
        period_s: float,
        n_rows: int,
    ) -> npt.NDArray[np.void]:
        """Hover from set-point to set-point.

        Args:
            setpoints: Time (s) from which each holds and position (m), shape (n, n_setpoints, 4).
            seeds: Seed and stream of each flight, shape (n, 2).
            period_s: Time between two rows.
            n_rows: Rows of each flight.

        Returns:
            Rows of `trace_dtype`, shape (n, n_rows).
        """
        setpoints = np.ascontiguousarray(setpoints, dtype=np.float64)
        seeds = np.ascontiguousarray(seeds, dtype=np.uint64)
        n, n_setpoints = setpoints.shape[:2]
        if setpoints.shape[2:] != (4,) or seeds.shape != (n, 2):
            raise NativeError(
                f"set-points of shape {setpoints.shape} and seeds of shape {seeds.shape}: not one flight each"
            )
        rows = np.zeros((n, n_rows), dtype=self._library.trace_dtype)
        call = self._library._c.ivl_sil_hover
        status = call(
            self._handle, _pointer(setpoints), n_setpoints, _pointer(seeds), n, period_s, _pointer(rows), n_rows
        )
        if status != 0:
            raise NativeError(f"the native hover of {n} flights failed with status {status}")
        return rows


def _keep(_: object) -> None:
    """Holds a reference until its owner is gone."""


@cache
def library() -> NativeLibrary:
    """The library of this process, loaded on first use."""
    return NativeLibrary(Path(os.environ.get(LIBRARY_ENV, DEFAULT_LIBRARY)))


def _declare(c: Any) -> None:
    u32p = ctypes.POINTER(ctypes.c_uint32)
    textp = ctypes.POINTER(ctypes.c_char_p)
    ptr, size, c_int, double = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int, ctypes.c_double
    for name, restype, argtypes in (
        ("ivl_sil_table", ctypes.POINTER(_CField), (c_int, u32p, u32p)),
        ("ivl_sil_abi_version", c_int, ()),
        ("ivl_sil_register_bits", c_int, (c_int,)),
        ("ivl_sil_model_create", ptr, (ptr, ctypes.c_char_p, size)),
        ("ivl_sil_model_free", None, (ptr,)),
        ("ivl_sil_model_derived", None, (ptr, ptr)),
        ("ivl_sil_model_surface", None, (ptr, ptr)),
        ("ivl_sil_model_camera", c_int, (ptr, ptr)),
        ("ivl_sil_surface_forward", None, (ptr, ptr)),
        ("ivl_sil_camera_film", ctypes.c_long, (ptr, ptr, size, ptr, ptr, ptr, ptr)),
        ("ivl_sil_rollouts", c_int, (ptr, ptr, size, c_int, ptr, ptr)),
        ("ivl_sil_trace", ctypes.c_long, (ptr, ptr, double, ptr, size, ptr)),
        ("ivl_sil_traces", c_int, (ptr, ptr, size, c_int, double, ptr, size, ptr, ptr)),
        ("ivl_sil_replay", c_int, (ptr, ptr, c_int, ptr, ptr, size, ptr)),
        ("ivl_sil_form", ctypes.c_uint32, (c_int, textp, textp)),
        ("ivl_sil_form_group", c_int, (c_int, ctypes.c_uint32, ctypes.POINTER(_CField), textp)),
        ("ivl_sil_policy_accepted", c_int, (ptr, c_int, ptr)),
        ("ivl_sil_policy_decide", None, (c_int, ptr, ptr, size, ptr)),
        ("ivl_sil_policy_crc", ctypes.c_uint32, (c_int, ptr)),
        ("ivl_sil_hover", c_int, (ptr, ptr, size, ptr, size, double, ptr, size)),
        ("ivl_sil_end_reason", ctypes.c_char_p, (c_int,)),
        ("ivl_sil_rule_name", ctypes.c_char_p, (c_int,)),
        ("ivl_sil_rule_discards", c_int, (c_int,)),
        ("ivl_sil_layout", ctypes.POINTER(_CField), (c_int, u32p, u32p)),
        ("ivl_sil_wire_version", c_int, ()),
        ("ivl_sil_model_config", ctypes.c_uint32, (ptr, ptr)),
        ("ivl_sil_phase_name", ctypes.c_char_p, (c_int,)),
    ):
        function = getattr(c, name)
        function.restype, function.argtypes = restype, list(argtypes)


def _text(pointer: ctypes.c_char_p) -> str:
    return (pointer.value or b"").decode()


def _field(row: _CField) -> Field:
    code = row.type.decode()
    if code not in _FIELD_TYPES:
        raise NativeError(f"the library's field {row.name.decode()} has the unknown type {code!r}")
    default = None if np.isnan(row.dflt) else float(row.dflt)
    return Field(
        row.name.decode(), code, row.offset, row.count, row.unit.decode(), row.lo, row.hi, default, row.doc.decode()
    )


def _dtype(fields: tuple[Field, ...], item_size: int) -> np.dtype[np.void]:
    for f in fields:
        if f.offset + f.count * _FIELD_TYPES[f.type] > item_size:
            raise NativeError(f"the library's field {f.name} ends beyond its record of {item_size} bytes")
    return np.dtype(
        {
            "names": [f.name for f in fields],
            "formats": [f.type if f.count == 1 else (f.type, (f.count,)) for f in fields],
            "offsets": [f.offset for f in fields],
            "itemsize": item_size,
        }
    )


def _pointer(array: npt.NDArray[Any]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
