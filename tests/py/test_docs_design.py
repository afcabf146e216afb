"""Files and rules that docs/DESIGN.md names, against what is there."""

import re
from pathlib import Path

import ivl
from ivl import forms, outcome
from ivl.learners import LEARNERS
from ivl.rewards import REWARDS

ROOT = Path(__file__).parents[2]
DESIGN = (ROOT / "docs" / "DESIGN.md").read_text(encoding="utf-8")
PACKAGE = Path(ivl.__file__).parent


def test_every_file_that_is_named_exists() -> None:
    named = set(re.findall(r"`((?:host|tests|tools|docs)/[\w/]+(?:\.\w+)?)`", DESIGN))
    assert {"host/ivl/rewards", "host/ivl/learners", "host/ivl/learning/loop.py", "host/ivl/outcome.py"} <= named
    assert [path for path in sorted(named) if not (ROOT / path).exists()] == []


def test_a_reward_is_one_file_and_one_row() -> None:
    helpers = {"__init__", "base", "parts"}
    assert {path.stem for path in (PACKAGE / "rewards").glob("*.py")} - helpers == set(REWARDS)


def test_a_form_is_one_file_and_one_row() -> None:
    files = {path.stem.removeprefix("ivl_form_") for path in (ROOT / "firmware" / "core").glob("ivl_form_*.c")}
    assert files == set(forms.forms())


def test_every_learner_is_in_the_registry() -> None:
    helpers = {"__init__", "base", "gp"}
    files = {path.stem for path in (PACKAGE / "learners").glob("*.py")} - helpers
    assert {entry.cls.__module__.rpartition(".")[2] for entry in LEARNERS.values()} == files


def test_what_counts_as_success_is_defined_once() -> None:
    names = ("four_leg", "clean", "solved", "stuck")
    homes = {name: [] for name in names}
    for path in sorted(PACKAGE.rglob("*.py")):
        for name in re.findall(rf"^def ({'|'.join(names)})\(", path.read_text(encoding="utf-8"), re.MULTILINE):
            homes[name].append(path)
    assert homes == {name: [Path(outcome.__file__)] for name in names}
