"""A connection with the vehicle's tables: parameters, log variables, memories."""

import struct
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from cflib.crazyflie.log import LogTocElement  # type: ignore[import-untyped]

from ivl.errors import LinkError
from ivl.links.connection import Connection, Waiter
from ivl.links.deadlines import DEADLINES, Deadlines

_PORT_PARAM, _PORT_MEM, _PORT_LOG = 2, 4, 5
_READ, _WRITE, _MISC, _MEM_READ = 1, 2, 3, 1
_GET_DEFAULT = 8
_IDENT_BYTES = 2
_MEM_CHUNK = 24
_LOG_BYTES_MAX, _LOG_ITEMS_MAX = 26, 9
_LOG_CREATE, _LOG_APPEND, _LOG_START = 6, 7, 3
_EEXIST = 17


@dataclass
class LogBlock:
    """Variables that the vehicle sends together; at most 26 bytes.

    Attributes:
        names: Log variables, "group.name".
        period_ms: A multiple of 10, up to 2540.
        values: The last values by name; empty until the first have come.
        seen_s: Time of arrival (monotonic clock), -inf before the first.
    """

    names: tuple[str, ...]
    period_ms: int
    values: dict[str, float] = field(default_factory=dict)
    seen_s: float = float("-inf")


class Session(Connection):
    """A connection, and what the vehicle lists in its tables."""

    def __init__(self, uri: str, deadlines: Deadlines = DEADLINES) -> None:
        """Connect; arguments and errors as for `Connection`."""
        self.values: dict[str, float] = {}
        """Parameters as last read or written."""
        self._n_blocks = 0
        super().__init__(uri, deadlines)

    # ---- parameters

    def has_param(self, name: str) -> bool:
        """Whether the vehicle has this parameter."""
        return self._element(self.cf.param.toc, name) is not None

    def param_type(self, name: str) -> str:
        """Type of a parameter as in the `struct` module, for example "<f"."""
        return str(self._param(name).pytype)

    def read(self, names: Iterable[str]) -> dict[str, float]:
        """Read parameters from the vehicle; they are then also in `values`."""
        names = list(names)
        elements = [self._param(name) for name in names]
        questions = [(struct.pack("<H", e.ident), struct.pack("<HB", e.ident, 0)) for e in elements]
        answers = self.ask_many(_PORT_PARAM, _READ, questions, f"reading {names[0] if names else 'nothing'} ...")
        for name, element, answer in zip(names, elements, answers, strict=True):
            if len(answer) != 3 + struct.calcsize(element.pytype):
                raise LinkError(f"{self.uri}: parameter {name}: its value came with {len(answer) - 3} bytes")
            self.values[name] = struct.unpack(element.pytype, answer[3:])[0]
        return {name: self.values[name] for name in names}

    def default(self, name: str) -> float:
        """Value of a parameter at the vehicle's start."""
        element = self._param(name)
        question = struct.pack("<BH", _GET_DEFAULT, element.ident)
        answer = self.ask(_PORT_PARAM, _MISC, question, question, f"default of {name}")
        if len(answer) != 4 + struct.calcsize(element.pytype) or answer[3] != 0:
            raise LinkError(f"{self.uri}: parameter {name}: the vehicle does not tell its default")
        return float(struct.unpack(element.pytype, answer[4:])[0])

    def write(self, values: Mapping[str, float], deadline_s: float | None = None) -> None:
        """Write parameters in any order; returns when the vehicle has acknowledged all of them.

        Raises:
            LinkError: A parameter is missing or read-only, the vehicle has taken another value, or is silent.
        """
        questions = []
        for name, value in values.items():
            element = self._param(name)
            if element.access:
                raise LinkError(f"{self.uri}: parameter {name} is read-only")
            data = struct.pack("<H", element.ident) + _pack(element.pytype, name, value)
            questions.append((data, data))
        answers = Waiter({data[:_IDENT_BYTES]: i for i, (data, _) in enumerate(questions)})
        with self.heard_by(_PORT_PARAM, _WRITE, answers):
            try:
                self.ask_many(_PORT_PARAM, _WRITE, questions, f"writing {', '.join(values)}"[:80], deadline_s)
            except LinkError:
                self._blame_a_changed_value(list(values), questions, answers)
                raise
        self.values.update(values)

    def _blame_a_changed_value(self, names: list[str], questions: list[tuple[bytes, bytes]], answers: Waiter) -> None:
        """Raise LinkError for a parameter that was answered with another value only: the vehicle did not take ours."""
        heard: dict[int, bytes] = {}
        while (item := answers.take(0.0))[0] >= 0:
            i, data = item
            heard[i] = data if heard.get(i) != questions[i][0] else heard[i]
        for i, data in heard.items():
            form = self._param(names[i]).pytype
            if data != questions[i][0] and len(data) == len(questions[i][0]):
                wanted, found = (struct.unpack(form, told[_IDENT_BYTES:])[0] for told in (questions[i][0], data))
                raise LinkError(
                    f"{self.uri}: parameter {names[i]}: value {wanted:g} is not what the vehicle has taken: it "
                    f"answers {found:g} (beyond its range?)"
                )

    def _param(self, name: str) -> Any:
        element = self._element(self.cf.param.toc, name)
        if element is None:
            raise LinkError(f"{self.uri}: the vehicle has no parameter {name} (its firmware is of another version)")
        return element

    @staticmethod
    def _element(toc: Any, name: str) -> Any:
        group, _, item = name.partition(".")
        return toc.toc.get(group, {}).get(item)

    # ---- log variables

    def has_log(self, name: str) -> bool:
        """Whether the vehicle has this log variable."""
        return self._element(self.cf.log.toc, name) is not None

    def log_type(self, name: str) -> str:
        """Type of a log variable as in the `struct` module."""
        return str(self._element(self.cf.log.toc, name).pytype)

    def start_log(self, block: LogBlock) -> None:
        """Let the vehicle send a block from now on, for as long as this connection lasts.

        Raises:
            LinkError: A variable is missing, the block is too large, or the vehicle refuses it.
        """
        self._n_blocks += 1
        ident = self._n_blocks
        elements = [self._element(self.cf.log.toc, name) for name in block.names]
        if None in elements:
            name = block.names[elements.index(None)]
            raise LinkError(f"{self.uri}: the vehicle has no log variable {name} (its firmware is of another version)")
        form = "<" + "".join(element.pytype[1:] for element in elements)
        if struct.calcsize(form) > _LOG_BYTES_MAX:
            raise ValueError(
                f"log block {block.names[0]} ...: {struct.calcsize(form)} bytes (allowed {_LOG_BYTES_MAX})"
            )
        self.listen(_PORT_LOG, 2, _log_listener(ident, form, block))
        items = [struct.pack("<BH", _log_code(element), element.ident) for element in elements]
        for first in range(0, len(items), _LOG_ITEMS_MAX):
            command = _LOG_CREATE if first == 0 else _LOG_APPEND
            self._log_command(bytes((command, ident)) + b"".join(items[first : first + _LOG_ITEMS_MAX]), block)
        self._log_command(bytes((_LOG_START, ident, block.period_ms // 10)), block)

    def _log_command(self, data: bytes, block: LogBlock) -> None:
        answer = self.ask(_PORT_LOG, 1, data, data[:2], f"log block {block.names[0]} ...")
        error = answer[2] if len(answer) > 2 else 0xFF
        if error not in (0, _EEXIST):  # a repeated command finds the block there already
            raise LinkError(f"{self.uri}: log block {block.names[0]} ...: refused with error {error}")

    # ---- memories

    def memory(self, kind: int) -> int | None:
        """Number of the first memory of a kind, None if the vehicle has none."""
        found = self.cf.mem.get_mems(kind)
        return int(found[0].id) if found else None

    def read_memory(self, number: int, address: int, size: int, what: str) -> bytes:
        """Read bytes of a memory.

        Raises:
            LinkError: The vehicle refuses, or the link is gone.
        """
        starts = range(address, address + size, _MEM_CHUNK)
        questions = []
        for start in starts:
            head = struct.pack("<BI", number, start)
            questions.append((head + bytes((min(_MEM_CHUNK, address + size - start),)), head))
        answers = self.ask_many(_PORT_MEM, _MEM_READ, questions, what)
        for answer, (question, _) in zip(answers, questions, strict=True):
            if len(answer) != 6 + question[5] or answer[5] != 0:
                raise LinkError(f"{self.uri}: {what}: the vehicle refuses to read it now")
        return b"".join(answer[6:] for answer in answers)


def _log_listener(ident: int, form: str, block: LogBlock) -> Callable[[bytes], None]:
    size = struct.calcsize(form)

    def listener(data: bytes) -> None:
        if len(data) == 4 + size and data[0] == ident:
            block.values = dict(zip(block.names, struct.unpack(form, data[4:]), strict=True))
            block.seen_s = time.monotonic()

    return listener


def _log_code(element: Any) -> int:
    return int(LogTocElement.get_id_from_cstring(element.ctype))


def _pack(form: str, name: str, value: float) -> bytes:
    try:
        return struct.pack(form, value if form[-1] in "efd" else int(value))
    except (struct.error, OverflowError) as error:
        raise ValueError(f"parameter {name}: value {value!r} does not fit into {form[-1]}: {error}") from error
