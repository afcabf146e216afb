"""Vehicles and landing gears: YAML files -> checked quantities -> the parameter vector of the native library.

A vehicle file holds groups of parameters (`body`, `rotor`, ...), a gear file holds six designs that share a `common`
part. Every number is written `{value: 0.0343, unit: kg, source: "..."}` with an optional `sigma` (standard deviation,
same unit). Names, units and ranges are those of the library's parameter table; vehicle and gear together give each
parameter at most once, and exactly once if it has no default.
"""

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ivl import native, yamlfile
from ivl.errors import ConfigError
from ivl.references import absolute, is_path

VEHICLES_DIR = Path(__file__).parent / "vehicles"
GEARS_DIR = Path(__file__).parent / "gears"
SENSORS_DIR = Path(__file__).parent / "sensors"
SENSING_GROUPS = ("sense", "rrev", "range", "flow", "camera")
"""Groups of parameters that a sensor set gives as a whole: what it leaves out is at its default."""
DEFAULT_VEHICLE, DEFAULT_GEAR, DEFAULT_GEAR_SET = "habas2021", "wide_short", "table1"
"""What is flown where nobody says anything else: the paper's vehicle with legs of the paper's Table I, which are those
that were built and flown. Who repeats the authors' simulation names its legs, as the shipped experiments do."""

Table = Mapping[str, native.Field]


class Quantity(BaseModel):
    """One number with its unit and where it comes from."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)

    value: float
    unit: str = Field(min_length=1)
    source: str = Field(min_length=1)
    sigma: float | None = Field(default=None, ge=0, allow_inf_nan=False)


class _Header(BaseModel):
    model_config = ConfigDict(strict=True, extra="ignore", frozen=True)

    name: str = Field(min_length=1)
    doc: str = Field(min_length=1)


class _SensorHeader(_Header):
    includes: list[str] = Field(default_factory=list)
    texture: str | None = None


class _Reference(BaseModel):
    """A number that is another one of the same sensor set, as the noise that a filter expects: `{from: rrev.noise}`."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)

    of: str = Field(alias="from", min_length=1)


@dataclass(frozen=True)
class Part:
    """A vehicle or a gear as read: its checked quantities by dotted parameter name.

    Attributes:
        name: Name, as used on the command line.
        doc: What it is, in a sentence.
        label: File (and design) that errors name.
        quantities: Quantity of each parameter that the file gives.
        texture: Surface that a rendered camera of a sensor set looks at; None without one.
    """

    name: str
    doc: str
    label: str
    quantities: Mapping[str, Quantity]
    texture: str | None = None


@dataclass(frozen=True)
class Parameters:
    """Every parameter of one world, in the unit of the library's table.

    Attributes:
        values: Value of each parameter, in table order.
        origin: Where each value comes from: a file's label, "default" or "override".
        sigma: Standard deviation of each value that a file gives with one and that no override replaces.
        texture: Surface that a rendered camera looks at, None without one.
    """

    values: Mapping[str, float]
    origin: Mapping[str, str]
    sigma: Mapping[str, float]
    texture: str | None = None

    def vector(self) -> npt.NDArray[np.float64]:
        """The values as the library takes them, shape (n_params,)."""
        return np.array(list(self.values.values()), dtype=np.float64)

    def digest(self) -> str:
        """SHA-256 over names and exact values: equal digests mean equal worlds."""
        text = "\n".join(f"{name}={value.hex()}" for name, value in self.values.items())
        if self.texture is not None:
            text += f"\ntexture={self.texture}"
        return hashlib.sha256(text.encode()).hexdigest()


def list_vehicles() -> list[str]:
    """Names of the vehicles that ship with the package."""
    return sorted(path.stem for path in VEHICLES_DIR.glob("*.yaml"))


def list_gear_sets() -> list[str]:
    """Names of the gear sets that ship with the package."""
    return sorted(path.stem for path in GEARS_DIR.glob("*.yaml"))


def list_gears(gear_set: str) -> list[str]:
    """Names of the designs in a gear set (a name or a path)."""
    return list(_designs(yamlfile.read(_locate(gear_set, GEARS_DIR, "gear set")), gear_set))


def gear_title(gear: str) -> str:
    """Name of a landing gear as the paper writes it: Wide-Short for wide_short."""
    *width, length = (word.capitalize() for word in gear.split("_"))
    return f"{' '.join(width)}-{length}" if width else length


def load_vehicle(name_or_path: str, table: Table | None = None) -> Part:
    """Read and check a vehicle.

    Args:
        name_or_path: A shipped name, or a path that ends in .yaml.
        table: Parameter table to check against; the library's if omitted.

    Raises:
        ConfigError: One line naming file, field, value and allowed range.
    """
    path = _locate(name_or_path, VEHICLES_DIR, "vehicle")
    data = yamlfile.read(path)
    header = yamlfile.validate(_Header, data, path.name)
    groups = {key: value for key, value in data.items() if key not in _Header.model_fields}
    return Part(header.name, header.doc, path.name, _quantities(groups, path.name, table or native.library().params))


def list_sensor_sets() -> list[str]:
    """Names of the sensor sets that ship with the package."""
    return sorted(path.stem for path in SENSORS_DIR.glob("*.yaml"))


def load_sensors(name_or_path: str, table: Table | None = None) -> Part:
    """Read and check a sensor set: the groups `SENSING_GROUPS`, and flight parameters that go with them.

    A set may name others under `includes`: it has what they have, a later one wins over an earlier one, and its own
    values win over all of theirs. A flight parameter `{from: rrev.noise}` has the value that this parameter has in the
    whole set, whichever file gives it; an override of the one does not change the other. Arguments and errors as
    `load_vehicle`.
    """
    table = table or native.library().params
    header, label, given = _load_sensors(name_or_path, table, ())
    quantities = {name: _followed(name, entry, given, table, label) for name, entry in given.items()}
    return Part(header.name, header.doc, label, quantities, header.texture)


def _followed(
    name: str, entry: Quantity | _Reference, given: Mapping[str, Quantity | _Reference], table: Table, label: str
) -> Quantity:
    """A number of a sensor set, or the one that it refers to."""
    if isinstance(entry, Quantity):
        return entry
    where = f"{label}: {name}: from {entry.of}"
    source = given.get(entry.of)
    if not isinstance(source, Quantity):
        numbers = [known for known, other in given.items() if isinstance(other, Quantity)]
        what = "the set gives it no number" if entry.of in given or entry.of in table else "unknown parameter"
        raise ConfigError(f"{where}: {what}{yamlfile.did_you_mean(entry.of, numbers)}")
    if source.unit != table[name].unit:
        raise ConfigError(f"{where}: its unit is {source.unit!r}, not {table[name].unit!r}")
    _check_range(source.value, table[name], where)
    return source.model_copy(update={"source": f"as {entry.of}"})


def _load_sensors(
    name_or_path: str, table: Table, including: tuple[Path, ...]
) -> tuple[_SensorHeader, str, dict[str, Quantity | _Reference]]:
    """Header, label, and numbers and references of a set and of what it includes."""
    path = _locate(name_or_path, SENSORS_DIR, "sensor set")
    if path in including:
        raise ConfigError(
            f"{path.name}: includes: {' -> '.join(p.stem for p in (*including, path))} goes round in circles"
        )
    data = yamlfile.read(path)
    header = yamlfile.validate(_SensorHeader, data, path.name)
    groups = {key: value for key, value in data.items() if key not in _SensorHeader.model_fields}
    for group in groups:
        if group not in (*SENSING_GROUPS, "firmware"):
            raise ConfigError(
                f"{path.name}: {group}: not part of a sensor set (allowed {', '.join(SENSING_GROUPS)}, firmware)"
            )
    given: dict[str, Quantity | _Reference] = {}
    texture = None
    for name in header.includes:
        included, _, theirs = _load_sensors(absolute(name, path.parent), table, (*including, path))
        given |= theirs
        texture = included.texture or texture
    header = header.model_copy(update={"texture": header.texture or texture})
    references = _references(groups, path.name, table)
    numbers = {
        group: {key: raw for key, raw in members.items() if f"{group}.{key}" not in references}
        if isinstance(members, dict)
        else members
        for group, members in groups.items()
    }
    return header, path.name, given | _quantities(numbers, path.name, table) | references


def _references(groups: Mapping[str, Any], label: str, table: Table) -> dict[str, _Reference]:
    """The flight parameters of a sensor set that are written `{from: ..}`."""
    members = groups.get("firmware")
    found = {}
    for key, raw in members.items() if isinstance(members, dict) else ():
        if isinstance(raw, dict) and "from" in raw:
            name = f"firmware.{key}"
            _table_field(name, label, table)
            found[name] = yamlfile.validate(_Reference, raw, f"{label}: {name}")
    return found


def without_sensors(vehicle: Part) -> Part:
    """The vehicle with the sensing taken out, to be replaced by a sensor set."""
    kept = {n: q for n, q in vehicle.quantities.items() if n.partition(".")[0] not in SENSING_GROUPS}
    return Part(vehicle.name, vehicle.doc, vehicle.label, kept)


def load_gear(design: str, gear_set: str = DEFAULT_GEAR_SET, table: Table | None = None) -> Part:
    """Read and check one design of a gear set (arguments and errors as `load_vehicle`)."""
    path = _locate(gear_set, GEARS_DIR, "gear set")
    data = yamlfile.read(path)
    yamlfile.validate(_Header, data, path.name)
    designs = _designs(data, path.name)
    if design not in designs:
        raise ConfigError(
            f"{path.name}: no gear {design!r}{yamlfile.did_you_mean(design, designs)} (allowed {', '.join(designs)})"
        )
    label = f"{path.name}[{design}]"
    own = designs[design]
    header = yamlfile.validate(_Header, {"name": design, **own}, label)
    table = table or native.library().params
    merged = _quantities(data.get("common", {}), path.name, table)
    for name, quantity in _quantities({k: v for k, v in own.items() if k != "doc"}, label, table).items():
        if name in merged:
            raise ConfigError(f"{label}: {name}: value {quantity.value!r} is given a second time (also under common)")
        merged[name] = quantity
    return Part(design, header.doc, label, merged)


def assemble(
    parts: Iterable[Part], overrides: Mapping[str, float] | None = None, table: Table | None = None
) -> Parameters:
    """Merge parts, defaults and overrides into one value for each parameter of the table.

    Args:
        parts: Vehicle and gear; no parameter may be in two of them.
        overrides: Values by dotted name, in the table's unit; they replace whatever the files say.
        table: Parameter table; the library's if omitted.

    Raises:
        ConfigError: A parameter is given twice, is missing, is unknown, or an override is out of range.
    """
    table = table or native.library().params
    values: dict[str, float] = {}
    origin: dict[str, str] = {}
    sigma: dict[str, float] = {}
    for part in parts:
        for name, quantity in part.quantities.items():
            if name in values:
                raise ConfigError(f"{part.label}: {name}: value {quantity.value!r} is also given by {origin[name]}")
            values[name], origin[name] = quantity.value, part.label
            if quantity.sigma:
                sigma[name] = quantity.sigma
    for name, value in (overrides or {}).items():
        values[name], origin[name] = check_override(name, value, table), "override"
        sigma.pop(name, None)
    for name, field in table.items():
        if name not in values:
            if field.default is None:
                raise ConfigError(f"{name} is missing: neither vehicle nor gear gives it (unit {field.unit})")
            values[name], origin[name] = field.default, "default"
    return Parameters({n: values[n] for n in table}, {n: origin[n] for n in table}, sigma)


def check_override(name: str, value: Any, table: Table | None = None) -> float:
    """Check one override against the table and return it as a float.

    Raises:
        ConfigError: Unknown name, not a finite number, or out of range.
    """
    table = table or native.library().params
    field = _table_field(name, "override", table)
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise ConfigError(
            f"override: {name}: value {value!r} is not a number{yamlfile.number_hint(value)} ({_allowed(field)})"
        )
    _check_range(float(value), field, f"override: {name}")
    return float(value)


def unit(name: str) -> str:
    """Unit of a parameter of the library's table."""
    return native.library().params[name].unit


def _locate(name_or_path: str, folder: Path, kind: str) -> Path:
    """A path is taken as given; a bare name is looked up in the package."""
    if is_path(name_or_path):
        path = Path(name_or_path)
        if not path.is_file():
            raise ConfigError(f"{name_or_path}: no such {kind} file")
        return path
    known = sorted(path.stem for path in folder.glob("*.yaml"))
    if name_or_path not in known:
        raise ConfigError(
            f"no {kind} {name_or_path!r}{yamlfile.did_you_mean(name_or_path, known)} (allowed {', '.join(known)})"
        )
    return folder / f"{name_or_path}.yaml"


def _designs(data: Any, label: str) -> dict[str, dict[str, Any]]:
    designs = data.get("designs") if isinstance(data, dict) else None
    if not isinstance(designs, dict) or not designs:
        raise ConfigError(f"{label}: designs: expected a mapping from design name to its parameters")
    unknown = set(data) - {"name", "doc", "common", "designs"}
    if unknown:
        raise ConfigError(f"{label}: {sorted(map(str, unknown))[0]}: unknown key (allowed name, doc, common, designs)")
    for name, design in designs.items():
        if not isinstance(name, str) or not isinstance(design, dict):
            raise ConfigError(f"{label}: designs.{name}: expected a mapping, got {type(design).__name__}")
    return designs


def _quantities(groups: Any, label: str, table: Table) -> dict[str, Quantity]:
    """Check `{group: {parameter: quantity}}` and flatten it to dotted names."""
    if not isinstance(groups, dict):
        raise ConfigError(f"{label}: expected a mapping of groups, got {type(groups).__name__}")
    result = {}
    for group, members in groups.items():
        if not isinstance(members, dict):
            _table_field(str(group), label, table)
            raise ConfigError(f"{label}: {group}: value {members!r}: expected a mapping of parameters")
        for key, raw in members.items():
            name = f"{group}.{key}"
            result[name] = _quantity(raw, _table_field(name, label, table), f"{label}: {name}")
    return result


def _quantity(raw: Any, field: native.Field, where: str) -> Quantity:
    """Check one number: shape, unit and range."""
    if not isinstance(raw, dict):
        form = f"{{value: .., unit: {field.unit}, source: ..}}"
        raise ConfigError(f"{where}: value {raw!r}: expected {form} ({_allowed(field)})")
    try:
        quantity = Quantity.model_validate(raw)
    except ValidationError as error:
        raise ConfigError(f"{where}: {yamlfile.explain(error)} ({_allowed(field)})") from error
    if quantity.unit != field.unit:
        raise ConfigError(
            f"{where}: value {quantity.value!r} has unit {quantity.unit!r}, expected {field.unit!r} ({_allowed(field)})"
        )
    _check_range(quantity.value, field, where)
    return quantity


def _check_range(value: float, field: native.Field, where: str) -> None:
    if not field.lo <= value <= field.hi:  # NaN compares false; infinity is in range only where the table says so
        raise ConfigError(f"{where}: value {value!r} is out of range ({_allowed(field)})")


def _allowed(field: native.Field) -> str:
    return f"allowed {field.lo:g} .. {field.hi:g} {field.unit}"


def _table_field(name: str, label: str, table: Table) -> native.Field:
    if name not in table:
        raise ConfigError(f"{label}: {name}: unknown parameter{yamlfile.did_you_mean(name, table)}")
    return table[name]
