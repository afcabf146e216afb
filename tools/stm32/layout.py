"""Where the members of a C struct lie, read from the debug information of a program or object file.

No list of members is written a second time: the compiler tells them.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from elftools.elf.elffile import ELFFile


@dataclass(frozen=True)
class Leaf:
    """A member that has no members: a number, an enum, a flag.

    Attributes:
        name: Path from the struct, "state.sense.sample.p_WB_m.x".
        offset: Bytes from the start of the struct.
        size: Bytes.
        kind: numpy kind: "f", "i", "u" or "b".
    """

    name: str
    offset: int
    size: int
    kind: str


_KINDS = {2: "b", 4: "f", 5: "i", 6: "i", 7: "u", 8: "u"}  # DW_ATE_*


@cache
def struct(program: Path, typedef: str) -> tuple[tuple[Leaf, ...], int]:
    """Leaves of a struct by the name of its typedef, in order of offset, and its size in bytes.

    Raises:
        LookupError: The debug information has no such type.
    """
    with program.open("rb") as file:
        for unit in ELFFile(file).get_dwarf_info().iter_CUs():
            for die in unit.iter_DIEs():
                if die.tag == "DW_TAG_typedef" and _name(die) == typedef:
                    inner = _bare(die)
                    return tuple(_leaves(inner, "", 0)), int(inner.attributes["DW_AT_byte_size"].value)
    raise LookupError(f"{program}: no type {typedef} in the debug information")


def mask(program: Path, typedef: str) -> npt.NDArray[np.uint8]:
    """0xff for each byte of a struct that belongs to a member, 0 for padding; shape (size,)."""
    leaves, size = struct(program, typedef)
    result = np.zeros(size, dtype=np.uint8)
    for leaf in leaves:
        result[leaf.offset : leaf.offset + leaf.size] = 0xFF
    return result


def dtype(program: Path, typedef: str) -> np.dtype[np.void]:
    """The struct as a flat numpy record, leaf by leaf."""
    leaves, size = struct(program, typedef)
    formats = [f"<{'u' if leaf.kind == 'b' else leaf.kind}{leaf.size}" for leaf in leaves]
    names, offsets = [leaf.name for leaf in leaves], [leaf.offset for leaf in leaves]
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": size})


def _name(die: Any) -> str:
    return str(die.attributes["DW_AT_name"].value.decode()) if "DW_AT_name" in die.attributes else ""


def _bare(die: Any) -> Any:
    """The type behind typedefs and qualifiers."""
    while die.tag in ("DW_TAG_typedef", "DW_TAG_const_type", "DW_TAG_volatile_type"):
        die = die.get_DIE_from_attribute("DW_AT_type")
    return die


def _leaves(die: Any, name: str, offset: int) -> list[Leaf]:
    die = _bare(die)
    if die.tag == "DW_TAG_array_type":
        return _leaves_of_array(die, name, offset)
    if die.tag in ("DW_TAG_structure_type", "DW_TAG_union_type"):
        found = []
        for member in (child for child in die.iter_children() if child.tag == "DW_TAG_member"):
            prefix = f"{name}.{_name(member)}" if name else _name(member)
            place = member.attributes.get("DW_AT_data_member_location")  # a union's members have none
            at = offset + (place.value if place else 0)
            found += _leaves(member.get_DIE_from_attribute("DW_AT_type"), prefix, at)
        return found
    size = int(die.attributes["DW_AT_byte_size"].value)
    if die.tag == "DW_TAG_enumeration_type":
        return [Leaf(name, offset, size, "i")]
    if die.tag != "DW_TAG_base_type":
        raise LookupError(f"{name}: a {die.tag} cannot cross to another processor")
    return [Leaf(name, offset, size, _KINDS[die.attributes["DW_AT_encoding"].value])]


def _leaves_of_array(die: Any, name: str, offset: int) -> list[Leaf]:
    element = die.get_DIE_from_attribute("DW_AT_type")
    (bound,) = [child for child in die.iter_children() if child.tag == "DW_TAG_subrange_type"]
    one = _leaves(element, "", 0)
    size = int(_bare(element).attributes["DW_AT_byte_size"].value)
    known = bound.attributes
    count = known["DW_AT_count"].value if "DW_AT_count" in known else known["DW_AT_upper_bound"].value + 1
    return [
        Leaf(f"{name}[{i}]{leaf.name and '.' + leaf.name}", offset + i * size + leaf.offset, leaf.size, leaf.kind)
        for i in range(count)
        for leaf in one
    ]
