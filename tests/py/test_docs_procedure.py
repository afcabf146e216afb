"""The pages with boxes to tick: their commands, options, targets and packages are those that exist."""

import re
import shlex
from pathlib import Path

import pytest

from ivl import cli, native

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "PROCEDURE.md").read_text(encoding="utf-8")
OTHERS = "".join((ROOT / "docs" / name).read_text(encoding="utf-8") for name in ("HOST.md", "SAFETY.md"))
CONTAINER = (ROOT / "tools" / "Containerfile").read_text(encoding="utf-8")
GROUPS = ("flight", "site")
COMMANDS = sorted(
    {
        command.strip()
        for pattern in (r"`(ivl [a-z][^`]*)`", r"^    (ivl [a-z][^#\n]*)")
        for command in re.findall(pattern, PAGE + OTHERS, re.MULTILINE)
    }
)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_the_options_that_are_shown(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    words = shlex.split(command)
    assert cli.run([*words[1 : 3 if words[1] in GROUPS else 2], "--help"]) == 0
    text = capsys.readouterr().out
    assert [word for word in words if word.startswith("--") and word not in text] == []


def test_enough_commands_are_found() -> None:
    assert len(COMMANDS) > 10


def test_every_target_of_make_exists() -> None:
    rules = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    named = {word for line in re.findall(r"`make ([a-z -]+)`", PAGE) for word in line.split()}
    assert {"setup", "build", "test", "cad"} <= named <= rules


def test_the_line_of_packages_is_that_of_the_container() -> None:
    line = re.search(r"apt-get install --no-install-recommends (.+)", PAGE)
    told = re.search(r"apt-get install -y --no-install-recommends ((?:.|\n)+?)&&", CONTAINER)
    assert line is not None
    assert told is not None
    assert sorted(line[1].split()) == sorted(told[1].replace("\\", " ").split())


def test_every_parameter_to_identify_and_every_rule_exists() -> None:
    params = native.library().params
    named = set(re.findall(r"`((?:body|rotor|sense|world|leg)\.\w+)`", PAGE))
    named |= {name for text in re.findall(r"--fit ([\w.,]+)", PAGE) for name in text.split(",")}
    assert len(named) >= 6
    assert [name for name in sorted(named) if name not in params] == []
    numbers = re.findall(r"(?:rule|cause|or|`ivl\.cause`) (\d+) \((\w+)\)", PAGE)
    assert len(numbers) >= 4
    assert [(n, name) for n, name in numbers if native.library().rule_name(int(n)) != name] == []


def test_every_step_has_a_box_a_deed_and_what_it_must_show() -> None:
    steps = [line for line in (PAGE + OTHERS).splitlines() if line.startswith("| [ ]")]
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in steps]
    assert len(rows) > 40
    assert all(len(row) in (3, 4) and all(row[1:]) for row in rows)
