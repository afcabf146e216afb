"""docs/FLIGHT_DATA.md says what the code does: columns, formats, options, limits."""

import re
import shlex
from pathlib import Path

import pytest

from ivl import cli
from ivl.flight import log, schema, streams, table
from ivl.flight.formats import FORMATS

PAGE = (Path(__file__).parents[2] / "docs" / "FLIGHT_DATA.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"^    (ivl flight .+)$", PAGE, re.MULTILINE)


def test_columns_are_those_of_the_schema() -> None:
    assert PAGE.endswith(schema.markdown()), "print it anew: python -c 'from ivl.flight import schema; ...'"
    assert f"Schema version {schema.SCHEMA_VERSION}" in PAGE


def test_formats_are_those_of_the_table() -> None:
    told = dict(re.findall(r"^\| `(\w+)` \| ([^|]+) \| [^|]+ \|$", PAGE, re.MULTILINE))
    assert {name: told[name] for name in FORMATS} == {name: form.doc for name, form in FORMATS.items()}


def test_options_are_those_of_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["flight", "import", "--help"]) == 0
    text = capsys.readouterr().out
    named = set(re.findall(r"`(--[a-z-]+)", PAGE))
    assert {"--map", "--outcome", "--judged-by", "--licence", "--attempts"} <= named
    assert [option for option in named if option not in text] == []


def test_numbers_are_those_of_the_code() -> None:
    for text in (
        f"fewer than {streams.N_SAMPLES_MIN} samples",
        f"pauses of more than {log.GAP_S:g} s",
        f"stands still for {log._FROZEN_S:g} s",
        f"sees it move by {log._FROZEN_M:g} m",
        f"at most {streams._STATE_S:g} s or three periods; tracked poses {streams._TRACK_S:g} s",
        f"(within {table._NORM_SLACK:g}; then",
    ):
        assert text in " ".join(PAGE.split()), text
    assert streams._PERIODS == 3


def test_every_link_leads_to_a_file() -> None:
    targets = re.findall(r"\]\(([^)#]+)\)", PAGE)
    assert targets
    assert [target for target in targets if not (Path("docs") / target).exists()] == []


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_the_options_that_are_shown(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    words = shlex.split(command)
    assert cli.run([*words[1:3], "--help"]) == 0
    text = capsys.readouterr().out
    assert [word for word in words if word.startswith("--") and word not in text] == []
