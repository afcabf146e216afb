"""Fixtures of the tests of recorded flights. The package is imported before numpy, which it sets up."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import ivl  # isort: split

import pytest

from ivl import cli

sys.path.insert(0, str(Path(__file__).parent))
assert ivl.__version__


@pytest.fixture(scope="session")
def truth() -> Any:
    """A simulated landing seen in tilted frames, so that no component of anything is zero."""
    from logs import simulated  # beside this file, found from here on

    return simulated(ivl.World("habas2021", "wide_short", "as_simulated"))


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Callable[..., str]:
    """Import files that must be refused: exit code 2, one line, nothing written. Returns the line."""

    def run(*sources: Path, form: str, options: tuple[str, ...] = ()) -> str:
        out = tmp_path / "out"
        words = ["flight", "import", *map(str, sources), "--format", form, "--out", str(out), *options]
        assert cli.run(words) == 2
        text = capsys.readouterr().err
        assert text.startswith("ivl: ")
        assert text.count("\n") == 1
        assert not out.exists()
        assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []
        return text.removeprefix("ivl: ").strip()

    return run
