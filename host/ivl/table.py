"""What the simulator returns, as arrays that can say what they are: outcomes of rollouts, and rows of a time series.

    out = world.rollouts(2.5, 90.0, np.linspace(3.0, 6.0, 100), 8.0)
    out                                 # what came of them, in words
    out.n_legs                          # a field, shape (100,)
    out.fields["n_legs"].doc            # what it means; also .unit, .lo, .hi
    out.to_pandas()                     # a data frame, with the arguments beside the outcomes
    out.to_xarray()                     # a data set, with the arguments as coordinates

Both are numpy record arrays, so that everything that numpy does with them goes on working.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import numpy.typing as npt

from ivl import native, outcome
from ivl.columns import codes, columns_of, values_of
from ivl.native import Field
from ivl.optional import needed
from ivl.quantity import Quantity

if TYPE_CHECKING:
    import pandas as pd  # type: ignore[import-untyped]
    import xarray as xr

_EXTRA = "frames"
_WORDS_MAX = 100


class Table(np.recarray[Any, Any]):
    """Records of one of the library's tables."""

    @property
    def fields(self) -> Mapping[str, Field]:
        """Name, unit, range and meaning of every field."""
        known = self._known()
        return {name: known[name] for name in self.dtype.names or () if name in known}

    @property
    def codes(self) -> Mapping[str, Mapping[int, str]]:
        """Fields whose numbers stand for names, with these names by number."""
        return {name: names for name, names in codes().items() if name in (self.dtype.names or ())}

    def to_pandas(self) -> "pd.DataFrame":
        """A data frame with one row for each record, and one column for each element of a field.

        The name of a column ends with its unit. Codes are categories. `frame.attrs["units"]` and
        `frame.attrs["docs"]` have unit and meaning of each column.

        Raises:
            MissingError: pandas is not installed.
        """
        pd = needed("pandas", _EXTRA)
        records = self.reshape(-1)
        columns = {name: values.reshape(-1) for name, (values, _) in self._beside().items()}
        about = {name: quantity for name, (_, quantity) in self._beside().items()}
        for name, element in columns_of(self.fields).items():
            columns[name] = values_of(records, element)
            field = self.fields[element[0]]
            about[name] = Quantity(name, field.unit, field.doc)
        frame = pd.DataFrame(columns)
        return describe(frame, about)

    def to_xarray(self) -> "xr.Dataset":
        """A data set with a variable for each field; variables have `units` and `long_name`.

        A vector has a dimension of its own, which is called as the field and counts from 1. An axis along which a
        single argument of the rollouts changes is called as that argument; the others are `axis_0`, `axis_1` ...

        Raises:
            MissingError: xarray is not installed.
        """
        xarray = needed("xarray", _EXTRA)
        dims, coordinates = self._axes()
        variables: dict[str, Any] = {}
        for name, field in self.fields.items():
            if name in coordinates:
                continue
            values = np.asarray(self[name])
            own = (*dims, f"{name}_i") if field.count > 1 else dims
            about = {"units": field.unit, "long_name": field.doc}
            if name in self.codes:
                about["codes"] = ", ".join(f"{code} {word}" for code, word in self.codes[name].items())
            variables[name] = (own, values, about)
            if field.count > 1:
                coordinates[f"{name}_i"] = (f"{name}_i", np.arange(1, field.count + 1), {})
        made: xr.Dataset = xarray.Dataset(variables, coordinates)
        return made

    def _known(self) -> Mapping[str, Field]:
        raise NotImplementedError

    def _beside(self) -> dict[str, tuple[npt.NDArray[Any], Quantity]]:
        """Columns beside the fields, each in the shape of the records."""
        return {}

    def _axes(self) -> tuple[tuple[str, ...], dict[str, Any]]:
        """Name of each axis, and coordinates."""
        return tuple(f"axis_{i}" for i in range(self.ndim)), {}


class Rollouts(Table):
    """Outcomes of rollouts, in the shape of the arguments of `ivl.World.rollouts`.

    What `World.rollouts` returns, and what is selected of it, also knows the arguments. Arrays that were made in
    another way (put together, copied into another shape) know the outcomes alone.
    """

    _arguments: Mapping[str, npt.NDArray[Any]] | None = None

    @classmethod
    def of(cls, outcomes: npt.NDArray[np.void], arguments: Mapping[str, npt.NDArray[Any]]) -> Self:
        """Outcomes with their arguments, which broadcast to the shape of the outcomes."""
        made = outcomes.view(cls)
        made._arguments = dict(arguments)
        return made

    @property
    def arguments(self) -> Mapping[str, npt.NDArray[Any]]:
        """Arguments of the rollouts by name, in the shape of the outcomes; empty if they are not known."""
        return {name: np.broadcast_to(value, self.shape) for name, value in (self._arguments or {}).items()}

    @property
    def four_leg(self) -> npt.NDArray[np.bool_]:
        """Where at least three feet are stuck at the end (`ivl.four_leg`)."""
        return outcome.four_leg(self)

    @property
    def clean(self) -> npt.NDArray[np.bool_]:
        """Where besides neither body nor rotor touched the ceiling (`ivl.clean`)."""
        return outcome.clean(self)

    def __getitem__(self, key: Any) -> Any:
        """A field, one record, or some of the rollouts with their arguments."""
        found = super().__getitem__(key)
        if isinstance(found, Rollouts) and self._arguments is not None and not _names_fields(key):
            found._arguments = {name: value[key] for name, value in self.arguments.items()}
        return found

    def __repr__(self) -> str:
        """What came of them, in words."""
        if not set(native.library().outcome_fields) <= set(self.dtype.names or ()):
            return str(np.asarray(self).__repr__())
        n, landed, touched = self.size, int(self.four_leg.sum()), int((self.body_contact != 0).sum())
        shape = f" of shape {self.shape}" if self.ndim != 1 else ""
        words = f"{landed} landed, {int(self.clean.sum())} of them clean; {touched} touched with body or rotors"
        return f"<{n} rollout{'' if n == 1 else 's'}{shape}: {words}; fields: {_list(self.dtype.names)}>"

    __str__ = __repr__

    def _known(self) -> Mapping[str, Field]:
        return native.library().outcome_fields

    def _beside(self) -> dict[str, tuple[npt.NDArray[Any], Quantity]]:
        return {name: (values, _about(name)) for name, values in self.arguments.items()}

    def _axes(self) -> tuple[tuple[str, ...], dict[str, Any]]:
        dims, coordinates = list(super()._axes()[0]), {}
        given = dict(self.arguments)
        for axis in range(self.ndim):
            alone = [name for name, values in given.items() if _changes_along(values) == [axis] and name != "stream"]
            if len(alone) == 1:
                dims[axis] = alone[0]
        for name, values in given.items():
            about = _about(name)
            along = _changes_along(values)
            first = tuple(slice(None) if axis in along else 0 for axis in range(values.ndim))
            attributes = {"units": about.unit, "long_name": about.doc}
            names = tuple(dims[axis] for axis in along)
            if self.size:
                coordinates[name] = (names, values[first], attributes)
        return tuple(dims), coordinates


class Rows(Table):
    """Rows of time series: of one landing shape (n_rows,), of several flights (..., n_rows)."""

    def __repr__(self) -> str:
        """How long they are."""
        if "t_s" not in (self.dtype.names or ()) or not self.size:
            return str(np.asarray(self).__repr__())
        shape = f" of shape {self.shape}" if self.ndim != 1 else ""
        span = f"{float(np.nanmin(self.t_s)):.3f} .. {float(np.nanmax(self.t_s)):.3f} s"
        return f"<{self.size} rows{shape}, {span}; fields: {_list(self.dtype.names)}>"

    __str__ = __repr__

    def _known(self) -> Mapping[str, Field]:
        return native.library().trace_fields

    def _axes(self) -> tuple[tuple[str, ...], dict[str, Any]]:
        flights = tuple(f"flight_{i}" for i in range(self.ndim - 1))
        if self.ndim != 1:
            return (*flights, "row"), {}
        field = self.fields["t_s"]
        return ("t_s",), {"t_s": ("t_s", np.asarray(self.t_s), {"units": field.unit, "long_name": field.doc})}


def describe(frame: Any, about: Mapping[str, Quantity]) -> Any:
    """Give a data frame the units and meanings of its columns, and names in place of codes."""
    pd = needed("pandas", _EXTRA)
    for name, names in codes().items():
        if name in frame:
            kept = pd.Categorical.from_codes(frame[name].to_numpy(), categories=list(names.values()))
            frame[name] = kept
    frame.attrs["units"] = {name: about[name].unit for name in frame if name in about}
    frame.attrs["docs"] = {name: about[name].doc for name in frame if name in about}
    return frame


def _names_fields(key: Any) -> bool:
    """Whether an index names a field or a list of fields."""
    return isinstance(key, str) or (isinstance(key, list) and bool(key) and all(isinstance(k, str) for k in key))


def _changes_along(values: npt.NDArray[Any]) -> list[int]:
    """Axes along which values that were broadcast are not all the same."""
    return [axis for axis in range(values.ndim) if (values != values.take([0], axis=axis)).any()] if values.size else []


def _about(name: str) -> Quantity:
    """Unit and meaning of an argument of a rollout."""
    from ivl import forms  # reads the forms of policies from the library

    fields = native.library().spec_fields
    if name in fields:
        return Quantity(name, fields[name].unit, fields[name].doc)
    for form in forms.forms().values():
        for parameter in form.params:
            if parameter.name == name:
                return Quantity(name, parameter.unit, parameter.doc)
    return Quantity(name, "1", "argument of the rollout")


def _list(names: Any) -> str:
    """Names in a row, not too many of them."""
    text = ", ".join(names)
    return text if len(text) <= _WORDS_MAX else f"{text[: text.rfind(',', 0, _WORDS_MAX)]} ... (.fields has all)"
