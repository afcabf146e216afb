"""Commands, links, targets and messages of every page: what they name is there."""

import re
import shlex
from pathlib import Path

import pytest
import typer.main

from ivl import cli

ROOT = Path(__file__).parents[2]
PAGES = {
    path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
    for path in sorted([*(ROOT / "docs").glob("*.md"), ROOT / "README.md"])
}
TREE = typer.main.get_command(cli.app).commands


def commands() -> list[str]:
    """Every command `ivl ...` of every page."""
    found = set()
    for text in PAGES.values():
        lines = re.findall(r"^ {4,}(?:\.venv/bin/)?(ivl [a-z].*)$", text, re.MULTILINE)
        for line in [*lines, *re.findall(r"`(?:\.venv/bin/)?(ivl [a-z][^`]*)`", text)]:
            for part in re.split(r" && |\s#|; | > | \| ", re.sub(r"\s+", " ", line) if "\n" in line else line):
                if (command := part.strip().removeprefix(".venv/bin/")).startswith("ivl "):
                    found.add(command)
    return sorted(found)


def words_of(command: str) -> tuple[list[str], list[str]]:
    """The words that name a command, and the options given to it."""
    words = shlex.split(command)[1:]
    group = hasattr(TREE.get(words[0]), "commands")
    named = words[: 2 if group and len(words) > 1 and re.fullmatch("[a-z-]+", words[1]) else 1]
    return named, [word.partition("=")[0] for word in words[len(named) :] if word.startswith("--")]


@pytest.fixture(scope="module")
def helps() -> dict[tuple[str, ...], str]:
    """What was printed by each help that was asked for."""
    return {}


@pytest.mark.parametrize("command", commands())
def test_a_command_exists_and_has_the_options_that_are_shown(
    command: str, helps: dict[tuple[str, ...], str], capsys: pytest.CaptureFixture[str]
) -> None:
    named, options = words_of(command)
    if tuple(named) not in helps:
        assert cli.run([*named, "--help"]) == 0
        helps[tuple(named)] = capsys.readouterr().out
    known = set(re.findall(r"--[\w-]+", helps[tuple(named)]))
    assert [option for option in options if option not in known] == []


def test_enough_commands_are_found() -> None:
    assert len(commands()) > 100


@pytest.mark.parametrize("page", PAGES)
def test_links_pictures_and_targets_exist(page: str) -> None:
    folder = (ROOT / page).parent
    targets = re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", PAGES[page])
    assert [target for target in targets if not (folder / target).exists()] == []
    rules = set(re.findall(r"^([a-z][a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    named = set(re.findall(r"`make ([a-z][a-z-]+)", PAGES[page]))
    named |= set(re.findall(r"^ {4}(?:nice )?make ([a-z][a-z-]+)", PAGES[page], re.MULTILINE))
    assert named <= rules


@pytest.mark.parametrize("page", PAGES)
def test_programs_that_are_named_exist(page: str) -> None:
    named = set(re.findall(r"(?:python |`)((?:tools|examples|docs)/[\w/]+\.py)", PAGES[page]))
    assert [path for path in sorted(named) if not (ROOT / path).exists()] == []


def test_messages_that_are_explained_are_messages() -> None:
    source = "\n".join(
        path.read_text(encoding="utf-8")
        for folder, kind in (("host/ivl", "*.py"), ("tools", "*.sh"), ("sim_sil", "*.c"))
        for path in sorted((ROOT / folder).rglob(kind))
    )
    rows = re.findall(r"^\| `([^`|]+)` \|", PAGES["docs/TROUBLESHOOTING.md"], re.MULTILINE)
    assert len(rows) > 12
    assert [row for row in rows if row not in source] == []
