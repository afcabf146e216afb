"""Every program of examples/ is run: those in Python here and in test_gym, those in C and C++ by `make example-cpp`."""

import importlib.util
import re
import sys
from pathlib import Path

import pytest

from ivl import experiment, yamlfile

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"


def test_every_example_is_run_somewhere() -> None:
    tests = "\n".join(path.read_text(encoding="utf-8") for path in sorted((ROOT / "tests" / "py").glob("test_*.py")))
    compiled = (ROOT / "tools" / "native.mk").read_text(encoding="utf-8")
    assert [path.name for path in EXAMPLES.glob("*.py") if not re.search(rf"\b{path.stem}\b", tests)] == []
    assert [path.name for path in EXAMPLES.glob("*.c*") if f"examples/{path.name}" not in compiled] == []
    assert [path.name for path in EXAMPLES.glob("*.ipynb") if path.name not in (ROOT / "Makefile").read_text()] == []


def test_optimisers_of_other_libraries_are_compared(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    data = experiment.load("paper_vertical").model_dump(mode="json")
    grid = {"rrev_c_per_s": {"lo": 4.5, "hi": 5.0, "step": 0.25}, "moment_y_Nmm": {"lo": 7.0, "hi": 9.0, "step": 1.0}}
    data["check"] = {"n_fresh": 5, "effort": 0.02, "grid": grid}  # what takes long is the judgement
    (tmp_path / "paper_vertical").write_text(yamlfile.dump(data))  # a file here comes before that of the package
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["optimisers.py", "--budget", "24", "--trials", "1"])
    spec = importlib.util.spec_from_file_location("optimisers", EXAMPLES / "optimisers.py")
    assert spec is not None
    assert spec.loader is not None
    optimisers = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(optimisers)
    optimisers.main()
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines if " lands " in line] == list(optimisers.LEARNERS)
