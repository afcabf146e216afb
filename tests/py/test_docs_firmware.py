"""The tables of docs/SAFETY.md and docs/FIRMWARE.md against the tables of the firmware that they describe."""

import re
from pathlib import Path

from ivl import native

ROOT = Path(__file__).parents[2]
CORE = ROOT / "firmware" / "core"


def text(*parts: str) -> str:
    return ROOT.joinpath(*parts).read_text(encoding="utf-8")


def rows_of(markdown: str, heading: str) -> list[list[str]]:
    """Cells of the table under a heading, without its head."""
    section = markdown.split(f"\n## {heading}\n", 1)[1].split("\n## ", 1)[0]
    lines = [line for line in section.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def test_safety_has_one_line_for_each_rule_in_the_order_of_their_numbers() -> None:
    rules = dict(native.library().rules())
    assert next(iter(rules)) == "none"
    del rules["none"]
    lines = rows_of(text("docs", "SAFETY.md"), "Rules")
    listed = [cells[0].strip("`") for cells in lines]
    assert listed == list(rules)
    assert [cells[4] for cells in lines] == ["discarded" if discards else "scored" for discards in rules.values()]
    enum = re.findall(r"IVL_RULE_(\w+),", text("firmware", "core", "ivl_types.h"))
    assert [name.lower() for name in enum[1:]] == listed


def test_each_rule_has_its_test() -> None:
    tests = text("tests", "c", "test_ivl_guard.c")
    for cells in rows_of(text("docs", "SAFETY.md"), "Rules"):
        name = cells[0].strip("`")
        assert re.search(rf"RUN_TEST\(test_rule_{name}_\w+\)", tests), name


def test_parameters_that_the_documents_name_exist() -> None:
    names = set(re.findall(r'X\(\w+, "ivl", "(\w+)"', (CORE / "ivl_vars.h").read_text(encoding="utf-8")))
    for cells in rows_of(text("docs", "SAFETY.md"), "Limits"):
        for name in re.findall(r"`(\w+)`", cells[1]):
            assert name in names, name
    for document in ("SAFETY.md", "FIRMWARE.md", "HARDWARE.md"):
        for name in re.findall(
            r"`((?:vbat|link|host|land|abort|fence|rearm|handover|speed|setpoint)_\w+)`", text("docs", document)
        ):
            assert name in names or name == "fence_", name


def test_firmware_lists_the_members_of_every_packet() -> None:
    header = text("firmware", "core", "ivl_wire.h")
    listed = {
        cells[1].split(",")[0]: (cells[0], cells[2]) for cells in rows_of(text("docs", "FIRMWARE.md"), "App channel")
    }
    tables = re.findall(r"#define IVL_WIRE_(\w+)\(X\)((?:.*\\\n)+.*\n)", header)
    assert [name for name, _ in tables] == list(listed)
    for name, body in tables:
        members = re.findall(r"X\((\w+), (\w+),", body)
        number, described = listed[name]
        assert described == ", ".join(f"{member} {kind}" for kind, member in members)
        assert re.search(rf"IVL_WIRE_TYPE_{name} = {number}\b", header)


def test_firmware_states_the_size_of_the_recorder() -> None:
    header = text("firmware", "core", "ivl_record.h")
    rows = int(re.search(r"IVL_RECORD_ROWS\s+(\d+)u", header)[1])  # type: ignore[index]
    assert f"{36 + 44 * rows:,} bytes: a header of 36 bytes, then {rows} rows of 44 bytes" in text(
        "docs", "FIRMWARE.md"
    ).replace("\n", " ")
