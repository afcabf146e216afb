"""What README.md says of files, targets and commands, against what is there."""

import json
import re
import shlex
from pathlib import Path

import pytest

from ivl import cli

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
COMMANDS = [line.split("  #")[0] for line in re.findall(r"^    \.venv/bin/ivl (.+)$", README, re.MULTILINE)]


def test_every_link_and_picture_leads_to_a_file() -> None:
    targets = re.findall(r"\]\(([^)#]+)\)", README)
    assert len(targets) > 10
    assert [target for target in targets if not (ROOT / target).exists()] == []


def test_it_is_one_screen_and_leads_to_the_index_of_all_pages() -> None:
    assert len(README.splitlines()) < 70
    assert "(docs/README.md)" in README


def test_every_target_of_make_exists() -> None:
    named = set(re.findall(r"(?:^    |`)make ([a-z-]+)", README, re.MULTILINE))
    rules = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    assert {"learn", "test", "bench"} <= named <= rules


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_the_options_that_are_shown(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    words = shlex.split(command.split(" && ")[0])
    assert cli.run([*words[: 2 if words[0] == "flight" else 1], "--help"]) == 0
    text = capsys.readouterr().out
    assert [word for word in words if word.startswith("--") and word not in text] == []


def test_the_picture_shows_what_its_caption_says(capsys: pytest.CaptureFixture[str]) -> None:
    caption = re.search(r"!\[One landing: (.+)\]\(docs/figures/landing\.png\)", README)
    assert caption is not None
    assert caption[1] == "approach, flip, touch-down of the fore feet, swing, four feet on the ceiling"
    words = shlex.split(next(command for command in COMMANDS if "--plot landing.png" in command))
    del words[words.index("--plot") : words.index("--plot") + 2]
    assert cli.run([*words, "--json"]) == 0
    landed = json.loads(capsys.readouterr().out)
    assert (landed["n_legs"], set(landed["leg_order"][:2]), landed["clean"]) == (4, {1, 4}, True)
