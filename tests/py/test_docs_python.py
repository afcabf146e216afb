"""The code of docs/PYTHON.md, run as it stands there."""

import pkgutil
import re
import sys
from pathlib import Path
from typing import Any

import pytest

import ivl
from ivl import experiment, yamlfile

GRID = {
    "rrev_c_per_s": {"lo": 4.5, "hi": 5.0, "step": 0.25},
    "moment_y_Nmm": {"lo": 7.0, "hi": 9.0, "step": 1.0},
}
PAGE = (Path(__file__).parents[2] / "docs" / "PYTHON.md").read_text(encoding="utf-8")


def test_the_code_of_the_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    blocks = re.findall(r"^```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    assert len(blocks) > 5
    monkeypatch.chdir(tmp_path)
    data = experiment.load("paper_vertical").model_dump(mode="json")
    data["check"] = {"n_fresh": 5, "effort": 0.02, "grid": GRID}  # what takes long is the judgement
    (tmp_path / "experiments").mkdir()
    for name in ("paper_vertical", "experiments/paper_vertical.yaml"):  # a file here comes before that of the package
        (tmp_path / name).write_text(yamlfile.dump(data))
    space: dict[str, Any] = sys.modules["__main__"].__dict__  # as in a notebook
    before = set(space)
    try:
        for block in blocks:
            exec(compile(block, "docs/PYTHON.md", "exec"), space)
        assert len(space["frame"]) == 16
        assert next(iter(space["data"].dims)) == "rrev_c_per_s"
        assert (tmp_path / "first.html").stat().st_size > 1e6
        assert ivl.load("runs/feet").rollouts()["reward"].max() <= 40.0
        assert ivl.load("runs/weighted").rollouts()["reward_angle"].max() == 0.0
        assert ivl.load("runs/wander").experiment.learner.name == "__main__:Wander"
    finally:
        for name in set(space) - before:
            del space[name]


def test_every_name_of_the_package_exists() -> None:
    names = set(re.findall(r"`(ivl\.[\w.]*\w)(?::(\w+))?[`(]", PAGE)) - {("ivl.sites", "")}  # a group of entry points
    assert len(names) > 10
    for name, attribute in names:
        pkgutil.resolve_name(f"{name}:{attribute}" if attribute else name)
