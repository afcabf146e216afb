"""What users write, and what machines do to it: a good result or one line, and never another number."""

import errno
import math
import os
import re
import stat
import subprocess
import sys
from decimal import Decimal, InvalidOperation
from pathlib import Path

import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st

from ivl import cli, experiment, files, model, references, run, yamlfile
from ivl.errors import ConfigError, StoreError
from ivl.experiment import Experiment
from ivl.native import library
from ivl.store import RunStore, lock_folder

Capture = pytest.CaptureFixture[str]
DTYPE = library().outcome_dtype


# ---- YAML


def by_eye(text: str) -> float | None:
    """The number that a person reads; None if it is none."""
    try:
        return float(Decimal(text))
    except InvalidOperation:
        return None


@given(st.text("0123456789+-.eE_:xobXOB, ", min_size=1, max_size=12))
@example("060")
@example("0o17")
@example("1_000")
@example("190:20:30.15")
@example("1e-6")
@example("-.5E+3")
@example("9" * 6000)
@example("1e400")
def test_a_number_is_what_the_eye_reads_or_refused(text: str) -> None:
    try:
        data = yamlfile.parse(f"x: {text}", "f.yaml")
    except ConfigError as error:
        said = str(error)
        if not said.startswith("f.yaml: ") or "\n" in said or len(said) > 300:
            pytest.fail(said)
        return
    value = data["x"]
    if isinstance(value, (int, float)):
        assert value == by_eye(text.strip())
    else:  # a comment, a list, text: no reader of YAML 1.1 may take it for a number
        assert not isinstance(value, str) or not isinstance(yaml.safe_load(f"x: {text}")["x"], (int, float))


@pytest.mark.parametrize("text", ["yes", "on", "off", "n", "2026-11-30", "12:30 h", "1.2.3"])
def test_words_are_words(text: str) -> None:
    assert yamlfile.parse(text, "f") == text


@given(st.text(max_size=20))
@example("060")
@example("1e3")
@example("yes")
@example("2026-11-30")
@example("<<")
@example("0o17")
def test_a_text_that_is_written_reads_back_in_both_versions(text: str) -> None:
    written = yamlfile.dump({"x": text, "y": [text]})
    assert yamlfile.parse(written, "f") == {"x": text, "y": [text]}
    assert yaml.safe_load(written) == {"x": text, "y": [text]}


@given(st.integers(-(2**70), 2**70))
def test_a_whole_number_that_is_written_reads_back(value: int) -> None:
    assert yamlfile.parse(yamlfile.dump({"x": value}), "f") == {"x": value}


def test_merge_keys_are_read_and_a_key_twice_is_not() -> None:
    text = "a: &p {x: 1, y: 2}\nb: {<<: *p, y: 3}\nc: {<<: [*p, {z: 4}]}\nd: *p\n"
    assert yamlfile.parse(text, "f") == {
        "a": {"x": 1, "y": 2}, "b": {"x": 1, "y": 3}, "c": {"x": 1, "y": 2, "z": 4}, "d": {"x": 1, "y": 2}
    }  # fmt: skip
    with pytest.raises(ConfigError, match="key 'y' is given twice"):
        yamlfile.parse("a: &p {x: 1}\nb: {<<: *p, y: 3, y: 4}\n", "f")


BOMB = "a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n" + "".join(
    f"{chr(98 + i)}: &{chr(98 + i)} [{', '.join([f'*{chr(97 + i)}'] * 10)}]\n" for i in range(9)
)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (BOMB, "more than 100000 values, aliases counted"),
        ("[" * 5000, "nested deeper than 40"),
        ("{a: " * 5000, "nested deeper than 40"),
        ("&a [*a]", "contains itself"),
        ("&a {x: *a}", "contains itself"),
        ("x: " + "y" * 2_000_000, "characters (allowed 1000000)"),
        ("!!python/object/apply:os.system [ls]", "is not allowed"),
        ("? [1, 2]\n: 3", "a key must be a single word"),
    ],
)
def test_what_is_too_much_is_refused_at_once(text: str, message: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(message)):
        yamlfile.parse(text, "f")


# ---- files that files name


@pytest.fixture
def own(tmp_path: Path, small: Experiment) -> Path:
    """An experiment with files of its own, in a folder whose name has everything in it."""
    folder = tmp_path / "my [lab] ü"
    folder.mkdir()
    for kind, name in (("vehicles/habas2021", "veh"), ("gears/as_simulated", "gears")):
        text = (Path(model.__file__).parent / f"{kind}.yaml").read_text(encoding="utf-8")
        (folder / f"{name}.yaml").write_text(text, encoding="utf-8")
    data = {**small.model_dump(mode="json"), "vehicle": "./veh.yaml", "gear_set": "gears.yaml"}
    (folder / "own.yaml").write_text(yamlfile.dump(data), encoding="utf-8")
    return folder


def test_paths_are_relative_to_the_file_that_names_them(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir("/")
    chosen = experiment.load(str(own / "own.yaml"))
    assert (chosen.vehicle, chosen.gear_set) == (str(own / "veh.yaml"), str(own / "gears.yaml"))
    chosen.make_world()
    monkeypatch.chdir(own)
    typed = experiment.load("own.yaml", ["vehicle=./veh.yaml"])
    assert typed == chosen


def test_a_file_is_its_name_and_content_however_it_is_spelled(own: Path, tmp_path: Path) -> None:
    spellings = [str(own / "veh.yaml"), f"{own}/./veh.yaml", f"{own}/../{own.name}/veh.yaml"]
    assert len({references.identity(references.absolute(text, own)) for text in spellings}) == 1
    copy = tmp_path / "veh.yaml"
    copy.write_bytes((own / "veh.yaml").read_bytes())
    assert references.identity(str(copy)) == references.identity(spellings[0])
    copy.write_bytes(copy.read_bytes() + b"# another\n")
    assert references.identity(str(copy)) != references.identity(spellings[0])
    assert references.identity("habas2021") == "habas2021"


def test_a_run_carries_its_files(own: Path, tmp_path: Path) -> None:
    chosen = experiment.load(str(own / "own.yaml"), ["budget=16", "check.n_fresh=2", "check.effort=0.001"])
    folder = tmp_path / "a run"
    first, values = run.run(chosen, folder, n_trials=1), chosen.make_world().params.values
    for path in own.iterdir():
        path.unlink()
    moved = folder.rename(tmp_path / "moved")
    again, n_trials = run.read_config(moved)
    assert again.make_world().params.values == values
    result = run.run(again, moved, n_trials=n_trials, resume=True)
    assert result.summary == {**first.summary, "run_dir": str(moved)}
    copy = next((moved / references.FOLDER).glob("veh-*.yaml"))
    copy.write_text(copy.read_text().replace("0.0", "0.1", 1))
    with pytest.raises(ConfigError, match=r"veh-.*\.yaml: is not as it was written"):
        run.read_config(moved)


def test_a_sensor_set_is_carried_with_what_it_includes(tmp_path: Path) -> None:
    (tmp_path / "base.yaml").write_text("name: base\ndoc: x\nincludes: [ideal]\n")
    (tmp_path / "mine.yaml").write_text("name: mine\ndoc: x\nincludes: [./base.yaml, mocap]\n")
    copies: dict[str, bytes] = {}
    name = references._copy(tmp_path / "mine.yaml", copies)
    assert len(copies) == 2
    (tmp_path / "run").mkdir()
    references.save(copies, tmp_path / "run")
    found = model.load_sensors(str(tmp_path / "run" / name))
    assert found.quantities == model.load_sensors(str(tmp_path / "mine.yaml")).quantities
    assert references._copy(tmp_path / "run" / name, {}) == name


# ---- writing


def test_a_file_that_cannot_be_written_stays_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "good.csv"
    path.write_text("good")

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left") as caught:
        files.write(path, "b" * 100_000)
    assert files.reason(caught.value) == "No space left on device (make room there)"
    assert path.read_text() == "good"
    assert [p.name for p in tmp_path.iterdir()] == ["good.csv"]


def test_a_link_named_like_an_output_is_replaced_and_not_followed(tmp_path: Path) -> None:
    target = tmp_path / "target"
    target.write_text("precious")
    (tmp_path / "out.json").symlink_to(target)
    files.write(tmp_path / "out.json", "mine")
    assert target.read_text() == "precious"
    assert (tmp_path / "out.json").read_text() == "mine"
    assert not (tmp_path / "out.json").is_symlink()


def test_a_device_is_written_to_and_not_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = subprocess.Popen(["cat", str(pipe)], stdout=subprocess.PIPE, text=True)
    files.write(pipe, "through")
    assert reader.communicate(timeout=60)[0] == "through"
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    files.write(Path("/dev/null"), "nothing")
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)


# ---- runs


def everything(folder: Path) -> dict[str, tuple[int, bytes]]:
    return {p.name: (p.stat().st_mtime_ns, p.read_bytes()) for p in sorted(folder.iterdir()) if p.is_file()}


def test_readers_change_nothing_and_exclude_nobody(small: Experiment, tmp_path: Path) -> None:
    chosen = small.model_copy(update={"budget": 16})
    folder = tmp_path / "a run"
    run.run(chosen, folder, n_trials=1)
    before = everything(folder)
    with (
        RunStore.open_reading(folder, DTYPE) as first,
        RunStore.open_reading(folder, DTYPE) as second,
        RunStore.open_existing(folder, DTYPE) as writer,
    ):
        assert len(writer.rollouts()) == len(first.rollouts()) == len(second.rollouts()) == 16
    assert everything(folder).keys() == before.keys()
    with RunStore.open_reading(folder, DTYPE) as reader:
        reader.rollouts()
    assert everything(folder)["run.sqlite"][1] == before["run.sqlite"][1]
    (folder / "run.sqlite").unlink()
    with pytest.raises(StoreError, match=r"run\.sqlite: is missing"):
        RunStore.open_reading(folder, DTYPE)
    assert not (folder / "run.sqlite").exists()


def test_a_reader_sees_what_a_running_writer_has_committed(small: Experiment, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    run.run(small.model_copy(update={"budget": 16}), folder, n_trials=1)
    with RunStore.open_existing(folder, DTYPE) as writer:
        writer._db.execute("CREATE TABLE more(x)")  # what it writes is in the log
        assert (folder / "run.sqlite-wal").stat().st_size > 0
        with RunStore.open_reading(folder, DTYPE) as reader:
            assert len(reader.rollouts()) == 16


def test_a_number_that_changed_in_a_database_is_not_read(small: Experiment, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    run.run(small.model_copy(update={"budget": 16}), folder, n_trials=1)
    for change in (
        "UPDATE rollout SET reward = reward * 1.0000001 WHERE idx = 3",
        "UPDATE episode SET n_scored = n_scored - 1",
        "UPDATE learner SET state = replace(state, '1', '2')",
        "DELETE FROM episode WHERE episode = 1",
        "DELETE FROM seal WHERE episode = 0",
    ):
        with RunStore.open_existing(folder, DTYPE) as store:
            store._db.execute("BEGIN")
            store._db.execute(change)
            with pytest.raises(ValueError, match=r"not as it was written|are missing"):
                store._check_seals()
            store._db.execute("ROLLBACK")


def test_only_a_lock_that_is_held_means_another_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import fcntl

    for number, message in (
        (errno.EWOULDBLOCK, "another process is working on this run"),
        (errno.ENOLCK, "cannot be locked: No locks available: put the run folder on a file system that has locks"),
    ):

        def refuse(_: int, __: int, number: int = number) -> None:
            raise OSError(number, os.strerror(number))

        monkeypatch.setattr(fcntl, "flock", refuse)
        with pytest.raises(StoreError, match=message):
            lock_folder(tmp_path)


# ---- the program


def program(*arguments: str, cwd: Path, **options: object) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-c", "from ivl.cli import main; main()", *arguments]
    given = {"capture_output": True, "text": True, "cwd": cwd, **options}
    return subprocess.run(command, check=False, **given)  # type: ignore[call-overload, no-any-return]


SHORT = (
    "--trials",
    "1",
    "--learner",
    "ephe",
    "--set",
    "budget=8",
    "--set",
    "check.n_fresh=2",
    "--set",
    "check.effort=0.001",
    "--set",
    "check.grid.rrev_c_per_s.step=1.0",
    "--set",
    "check.grid.moment_y_Nmm.step=4.0",
)
PAPER = "experiments/paper_vertical.yaml"


def test_an_ascii_terminal_gets_the_same_files(tmp_path: Path) -> None:
    done = program("learn", PAPER, *SHORT, cwd=tmp_path, env={**os.environ, "PYTHONIOENCODING": "ascii"})
    assert done.returncode == 0, done.stderr
    assert done.stderr.isascii()
    assert (tmp_path / "runs" / "paper_vertical-ephe-seed0-x1" / "result.json").exists()


def test_programs_that_start_at_once_get_a_folder_each(tmp_path: Path) -> None:
    command = [sys.executable, "-c", "from ivl.cli import main; main()", "learn", PAPER, *SHORT]
    started = [subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) for _ in range(3)]
    for process in started:
        _, said = process.communicate()
        assert process.returncode == 0, said
    assert len(list((tmp_path / "runs").iterdir())) == 3


def test_an_output_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    with Path("/dev/full").open("w") as full:
        done = program("list", "vehicles", cwd=tmp_path, stdout=full, stderr=subprocess.PIPE, capture_output=False)
    assert (done.returncode, done.stderr) == (1, "ivl: output: No space left on device (make room there)\n")


@pytest.mark.parametrize(
    "arguments",
    [
        ["learn", PAPER, "--seed", "18446744073709551616"],
        ["learn", PAPER, "--set", "angle_deg=060"],
        ["learn", "runs/[/red] :warning:.yaml"],
        [
            "rollout",
            "--speed",
            "2.5",
            "--angle",
            "90",
            "--rrev",
            "4",
            "--moment",
            "8",
            "--vehicle",
            "no/[bold]veh.yaml",
        ],
        ["report", "run [/] x"],
        ["export", "a[b].csv"],
    ],
)
def test_what_is_wrong_is_one_literal_line(arguments: list[str], capsys: Capture) -> None:
    code = cli.run(arguments)
    said = capsys.readouterr().err
    assert code in (1, 2)
    assert said.startswith("ivl: ")
    assert said.count("\n") == 1
    named = next((a for a in arguments if "[" in a), "")
    assert named in said


@given(st.text(st.characters(blacklist_categories=["Cs", "Cc"], blacklist_characters="/"), min_size=1, max_size=30))
@example("[/red]")
@example(":warning:")
@example("a[b]")
def test_a_name_is_printed_as_it_is(name: str) -> None:
    from ivl.cli import console

    with console.err.capture() as captured:
        console.say(f"run folder: {name}")
    assert captured.get() == f"run folder: {name}\n"


def test_infinity_and_nan_are_said_with_a_point() -> None:
    found = yamlfile.parse("[.inf, -.inf, .nan, inf, nan]", "f")
    assert found[:2] == [math.inf, -math.inf]
    assert math.isnan(found[2])
    assert found[3:] == ["inf", "nan"]
