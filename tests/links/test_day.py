"""A day in a room, rehearsed by `ivl learn --rehearse` with answers from a file."""

import json
from pathlib import Path

import pytest

from ivl import cli, files, yamlfile
from ivl.links import preflight
from ivl.site import file as site_file

SETTINGS = ["n_rollouts=2", "budget=4", "check.n_fresh=5", "check.effort=0.02", "learner.name=ephe_robust"]
GRID = [
    "check.grid.rrev_c_per_s={lo: 4.0, hi: 5.0, step: 0.5}",
    "check.grid.moment_y_Nmm={lo: 6.0, hi: 9.0, step: 1.0}",
]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with a site file as `ivl site new` writes it."""
    monkeypatch.chdir(tmp_path)
    files.write_new(tmp_path / "lab.yaml", site_file.TEMPLATE.read_bytes())
    return tmp_path


@pytest.fixture(autouse=True)
def _slow_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy machine answers pings late; that is no fault of the room."""
    monkeypatch.setattr(preflight, "P95_S_MAX", 10.0)


def learn(answers: list[str], *words: str) -> int:
    """Rehearse a day with these answers."""
    Path("answers.txt").write_text("\n".join(answers))
    settings = [word for text in (*SETTINGS, *GRID) for word in ("--set", text)]
    first = ["experiments/paper_flight.yaml", *settings, "--site", "lab.yaml"] if "--resume" not in words else []
    return cli.run(
        [
            "learn",
            *first,
            "--out",
            "run",
            "--rehearse",
            "--script",
            "calm",
            "--answers",
            "answers.txt",
            *words,
            "--json",
        ]
    )


def test_a_day_is_rehearsed_stopped_and_resumed(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert learn(["", "fly 2", "fly 1", "4", "clean", "veto", "stop"]) == 1
    told = capsys.readouterr()
    assert "stopped by the operator (the run can be resumed)" in told.err
    assert told.err.count("not understood") == 2
    kept = yamlfile.read(folder / "run" / "config.yaml")
    assert kept["overrides"]["world.ceiling_height"]["value"] == 2.1
    assert (folder / "run" / kept["site"]).read_bytes() == site_file.TEMPLATE.read_bytes()
    (folder / "lab.yaml").unlink()
    landing = ["discard", "go on", "fly 3", "3", "touched", "fly 4", "0", "clean"]
    assert learn(["fly 3", *landing], "--resume") == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["rollouts"], result["discarded"]) == (3, 1)
    assert result["warnings"][-1] == "flights that do not count, by cause: discarded 1"
    journal = [json.loads(line) for line in (folder / "run" / "flights.jsonl").read_text().splitlines()]
    assert [line["what"].partition(":")[0] for line in journal] == [
        "flown", "vetoed", "discarded", "not begun", "flown", "flown",
    ]  # fmt: skip
    assert [line.get("n_legs") for line in journal if line["what"] == "flown"] == [4, 3, 0]
    assert len(list((folder / "run" / "recordings").iterdir())) == 3


@pytest.mark.usefixtures("folder")
def test_a_rehearsed_day_has_cameras_of_its_own(capsys: pytest.CaptureFixture[str]) -> None:
    assert learn([], "--mocap", "simulator") == 2
    assert "a rehearsed day has cameras of its own: leave --mocap out" in capsys.readouterr().err


@pytest.mark.usefixtures("folder")
def test_answers_from_a_file_are_for_rehearsals_alone(capsys: pytest.CaptureFixture[str]) -> None:
    Path("answers.txt").write_text("fly 1")
    for words in (["--uri", "udp://127.0.0.1:9"], []):
        assert cli.run(["learn", "experiments/paper_flight.yaml", "--answers", "answers.txt", *words]) == 2
        assert "only a rehearsal" in capsys.readouterr().err
    assert learn([]) == 1
    assert "answers.txt: no answer is left (the run can be resumed)" in capsys.readouterr().err
