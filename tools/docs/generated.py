"""Pages of the reference that are generated from the package: commands, fields of files, numbers of the simulator."""

import contextlib
import io
import os
from collections.abc import Iterator, Mapping
from typing import Any

import typer.main

from ivl import cli, native, template
from ivl.columns import codes

WIDTH = 100


def pages() -> dict[str, str]:
    """Text of each page by the name of its file."""
    return {"COMMANDS.md": commands(), "FILES.md": files(), "NUMBERS.md": numbers()}


def commands() -> str:
    """The help of every command."""
    parts = ["# Commands\n\nEach text is what `--help` prints.\n"]
    for words in sorted(_commands(typer.main.get_command(cli.app))):
        parts.append(f"## ivl {' '.join(words)}\n\n```text\n{_help(words).strip()}\n```\n")
    return "\n".join(parts)


def files() -> str:
    """Every field of every kind of file, from the schemas."""
    parts = [
        "# Files\n\nEvery field of the files that people write. `ivl schema KIND` prints the same as a JSON schema, by "
        "which an editor completes and checks a file. A parameter of the world ([NUMBERS](NUMBERS.md)) stands under "
        "`overrides`.\n"
    ]
    for kind in template.kinds():
        schema = template.schema(kind)
        parts.append(f"## A file of the kind {kind}\n\n{_sentence(schema.get('description', ''))}\n\n{_fields(schema)}")
        for name, part in schema.get("$defs", {}).items():
            if "properties" in part:
                about = _sentence(part.get("description", ""))
                parts.append(f"### {name} in {kind}\n\n{about}\n\n{_fields(part)}")
            elif "enum" in part:
                words = ", ".join(f"`{word}`" for word in part["enum"])
                parts.append(f"### {name} in {kind}\n\nOne of {words}.\n")
    return "\n".join(parts)


def numbers() -> str:
    """Parameters of a world, fields of an outcome and columns of a trace, with their units."""
    library = native.library()
    parts = [
        "# Numbers of the simulator\n\n## Parameters of a world\n\n`ivl list params` prints them, "
        "and `--set NAME=VALUE` changes one.\n",
        _table(
            ("name", "default", "range", "unit", "meaning"),
            [
                (f"`{p.name}`", _number(p.default), f"{_number(p.lo)} .. {_number(p.hi)}", p.unit, p.doc)
                for p in library.params.values()
            ],
        ),
    ]
    for heading, fields in (
        ("Fields of an outcome", library.outcome_fields),
        ("Columns of a trace", library.trace_fields),
    ):
        rows = [
            (f"`{name}`", str(field.count), f"{_number(field.lo)} .. {_number(field.hi)}", field.unit, field.doc)
            for name, field in fields.items()
        ]
        parts.append(f"## {heading}\n\n{_table(('name', 'numbers', 'range', 'unit', 'meaning'), rows)}")
    rows = [(f"`{name}`", ", ".join(f"{c} {word}" for c, word in names.items())) for name, names in codes().items()]
    parts.append(f"## Codes\n\n{_table(('field', 'meaning of its numbers'), rows)}")
    return "\n".join(parts)


def _commands(group: Any, words: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Words of each command under a group."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from _commands(command, (*words, name))
        else:
            yield (*words, name)


def _help(words: tuple[str, ...]) -> str:
    """What a command prints with --help."""
    printed, before = io.StringIO(), os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = str(WIDTH)
    try:
        with contextlib.redirect_stdout(printed):
            code = cli.run([*words, "--help"])
    finally:
        if before is None:
            del os.environ["COLUMNS"]
        else:
            os.environ["COLUMNS"] = before
    if code:
        raise RuntimeError(f"ivl {' '.join(words)} --help: exit code {code}")
    return printed.getvalue()


def _fields(schema: Mapping[str, Any]) -> str:
    """Table of the fields of an object."""
    required = schema.get("required", ())
    rows = []
    for name, field in schema.get("properties", {}).items():
        default = "required" if name in required else _default(field)
        rows.append((f"`{name}`", _type(field), default, field.get("description", "")))
    return _table(("field", "type", "default", "meaning"), rows)


def _type(field: Mapping[str, Any]) -> str:
    """Type and range of a field in words."""
    if "$ref" in field:
        return field["$ref"].rpartition("/")[2]
    if "anyOf" in field:
        return " or ".join(dict.fromkeys(_type(each) for each in field["anyOf"]))
    if "enum" in field or "const" in field:
        return ", ".join(f"`{word}`" for word in field.get("enum", [field.get("const")]))
    kind = field.get("type", "any")
    if kind == "array":
        kind = f"list of {_type(field.get('items', {}))}"
    elif kind == "object" and isinstance(field.get("additionalProperties"), dict):
        kind = f"names with {_type(field['additionalProperties'])}"
    limits = [f"{sign} {field[key]:g}" for key, sign in _LIMITS.items() if key in field]
    return " ".join([kind, *limits]).replace("null", "none")


_LIMITS = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}


def _default(field: Mapping[str, Any]) -> str:
    """Default of a field; what is made anew for each file has none that could be shown."""
    if "default" not in field:
        return ""
    value = field["default"]
    if value is None:
        return "none"
    text = f"{value}"
    return f"`{text}`" if len(text) <= 40 else "long"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:g}"


def _sentence(text: str) -> str:
    """First paragraph of a docstring."""
    return " ".join(text.split("\n\n", 1)[0].split())


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    """A table in Markdown."""
    lines = [head, tuple("---" for _ in head), *rows]
    return "".join(f"| {' | '.join(_cell(cell) for cell in line)} |\n" for line in lines)


def _cell(text: str) -> str:
    return " ".join(text.replace("|", "\\|").split())
