"""Forms of policies: what the numbers of a theta mean, which the flight core's own table says.

form = ivl.forms.by_name("constant")
print(form.names, [p.unit for p in form.params])

A theta is given in the units that people use (N mm, say); `Form.to_si` turns it into the numbers that travel.
"""

import hashlib
import json
import re
import sqlite3
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

from ivl import native
from ivl.errors import ArgumentError, NativeError

PAPER = "constant"
"""The paper's form, and the default everywhere."""
_COLUMNS = frozenset(
    ("trial", "episode", "idx", "number", "status", "reward", "gear", "vehicle", "gear_set", "learner", "form")
)
"""Names of columns and arguments that stand beside those of the parameters."""
_SI_DIGITS = 9  # of a float in single precision


@dataclass(frozen=True)
class Parameter:
    """One parameter of a form.

    Attributes:
        name: With its unit, for files and tables.
        symbol: For people, with an index behind an underscore.
        unit: That people use.
        si: One unit in SI.
        lo: Smallest value that a vehicle accepts, in `unit`.
        hi: Largest value that a vehicle accepts, in `unit`.
        doc: One line.
    """

    name: str
    symbol: str
    unit: str
    si: float
    lo: float
    hi: float
    doc: str

    @property
    def label(self) -> str:
        """Symbol and unit as they stand at an axis."""
        stem, _, index = self.symbol.partition("_")
        stem = f"${stem}$" if len(stem) == 1 else stem
        return f"{stem}$_{{{index}}}$ ({self.unit})" if index else f"{stem} ({self.unit})"


@dataclass(frozen=True)
class Form:
    """A form of policies.

    Attributes:
        number: Row of the table of the flight core.
        name: How files and commands call it.
        doc: One line.
        params: Its parameters, in the order of every theta.
    """

    number: int
    name: str
    doc: str
    params: tuple[Parameter, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(p.name for p in self.params)

    @property
    def n(self) -> int:
        """Number of parameters."""
        return len(self.params)

    @property
    def digest(self) -> str:
        """SHA-256 of the name of the form, and of the names, units and ranges of its parameters in their order."""
        rows = [[p.name, p.unit, p.si, p.lo, p.hi] for p in self.params]
        return hashlib.sha256(json.dumps([self.name, rows]).encode()).hexdigest()

    def to_si(self, theta: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Numbers in SI units of a theta in the units of the parameters, shape (..., n) each.

        Raises:
            ArgumentError: The last axis has another length, or a value is out of its range.
        """
        values = np.asarray(theta, dtype=np.float64)
        if values.shape[-1:] != (self.n,):
            raise ArgumentError(
                f"a policy of the form {self.name} has {self.n} parameters ({', '.join(self.names)}), "
                f"not an array of shape {values.shape}"
            )
        for p, column in zip(self.params, np.moveaxis(values, -1, 0), strict=True):
            good = (column >= p.lo) & (column <= p.hi)
            if not good.all():
                value = float(column[~good].flat[0])
                raise ArgumentError(
                    f"form {self.name}: {p.name}: value {value!r} is out of range "
                    f"(allowed {p.lo:g} .. {p.hi:g} {p.unit})"
                )
        si: npt.NDArray[np.float64] = np.array([p.si for p in self.params])
        return values * si

    def crc(self, theta: npt.ArrayLike) -> int:
        """Checksum by which a vehicle names this policy."""
        return native.library().policy_crc(self.number, self.to_si(theta))

    def describe(self, theta: npt.ArrayLike) -> str:
        """A theta as people read it."""
        values = np.asarray(theta, dtype=np.float64).tolist()
        return ", ".join(f"{p.symbol} {value:.5g} {p.unit}" for p, value in zip(self.params, values, strict=True))


@cache
def forms() -> dict[str, Form]:
    """All forms that this library has, by name."""
    found = [
        Form(number, name, doc, tuple(_parameter(*row) for row in rows))
        for number, (name, doc, rows) in enumerate(native.library().forms())
    ]
    for form in found:
        _check_names(form)
    return {form.name: form for form in found}


def _check_names(form: Form) -> None:
    """Names of parameters become columns, keys and arguments: refuse those that something else has, or no column can.

    Raises:
        NativeError: A name is no name, or is taken.
    """
    taken = {name.lower() for name in native.library().spec_fields} | _COLUMNS
    for name in form.names:
        why = "" if re.fullmatch(r"[A-Za-z]\w*", name) else "it is no word of letters, digits and _"
        why = why or ("it is taken" if name.lower() in taken else "")
        if not why:
            try:
                sqlite3.connect(":memory:").execute(f"CREATE TABLE t({name} REAL)")
            except sqlite3.Error:
                why = "it is a word of SQL"
        if why:
            raise NativeError(f"policy form {form.name}: parameter {name!r}: {why}")
        taken.add(name.lower())


def by_name(name: str) -> Form:
    """A form by its name.

    Raises:
        ArgumentError: There is none with that name.
    """
    if name not in forms():
        raise ArgumentError(f"policy form {name!r} is unknown (allowed {', '.join(forms())})")
    return forms()[name]


def _parameter(symbol: str, field: native.Field) -> Parameter:
    si = _decimal(field.default if field.default is not None else 1.0)
    return Parameter(
        field.name,
        symbol,
        field.unit,
        si,
        _decimal(_decimal(field.lo) / si),
        _decimal(_decimal(field.hi) / si),
        field.doc,
    )


def _decimal(value: float) -> float:
    """The shortest decimal number that rounds to a float of the table, which is the one that its source says."""
    return float(np.format_float_positional(np.float32(value), precision=_SI_DIGITS, unique=True))
