"""The estimator on rendered pictures: against truth, floating point, other processors, and a fuzzer."""

import dataclasses
import subprocess
from pathlib import Path

import machines
import numpy as np
import pytest
import reference
from typer.testing import CliRunner

from ivl.camera import motion, native, study, textures
from ivl.cli import app
from ivl.errors import ArgumentError

N_APPROACHES = 6
# a few approaches, each with one error of attitude: steep ones, in which that counts less
STEEP_DEG = (60.0, 90.0)
WIDER = 1.3
MOST_INSTRUCTIONS = {"rv32imac": 1_700_000, "cortex-m4": 1_700_000, "aarch64": 1_400_000}
MOST_OF_A_START = 5_000_000


def _case(name: str) -> study.Case:
    return next(case for case in study.CASES if case.name == name)


@pytest.mark.parametrize("name", ["noise", "dots", "low contrast", "panels"])
def test_cues_are_as_good_as_they_must_be(name: str) -> None:
    case = dataclasses.replace(_case(name), angles_deg=STEEP_DEG)
    row = study.figures(case, study.readings(case, N_APPROACHES, seed=1))
    assert row.n > 80
    assert row.valid > 0.9
    assert abs(row.bias) < WIDER * 0.01
    assert row.sigma < WIDER * case.limits["sigma"]
    assert row.outliers < 0.02
    assert row.of_y < WIDER * 0.05
    assert row.within > 0.85


@pytest.mark.parametrize("name", ["white wall", "lines"])
def test_what_cannot_be_seen_is_not_told(name: str) -> None:
    case = _case(name)
    assert study.figures(case, study.readings(case, N_APPROACHES, seed=2)).invalid >= 0.97


def test_a_reading_is_that_of_floating_point() -> None:
    camera = native.Camera(vignetting=0.0)
    errors = []
    for texture, seed in (("noise", 1), ("dots", 2)):
        flown = motion.fly(motion.Approach(2.5, np.deg2rad(60.0), rrev_per_s=(2.0, 6.0)), np.random.default_rng(seed))
        seen = native.look(camera, textures.make(texture), flown.rows, seed=seed, pictures=True)
        assert seen.pictures is not None
        told = [reference.rotation(q) for q in flown.rows[:, 14:18]]
        for i in range(6, len(flown.rows), 3):
            reading = seen.readings[i]
            then = i - int(reading["frames"])
            normal = told[i].T @ np.array([0.0, 0.0, 1.0])
            p = reference.fit(
                reference.binned(seen.pictures[i]),
                reference.binned(seen.pictures[then]),
                told[then].T @ told[i],
                normal,
            )
            closing = float(normal @ p)
            errors.append(seen.number("rrev")[i] / (closing / (1 + closing / 2) / (reading["gap"] * 1e-6)) - 1)
    assert len(errors) >= 10
    assert abs(np.mean(errors)) < 0.0015
    assert np.sqrt(np.mean(np.square(errors))) < 0.003


@pytest.mark.parametrize("name", list(machines.MACHINES))
def test_every_processor_gives_the_same_bits_within_its_budget(name: str) -> None:
    emulated, host = machines.Emulated(name), machines.Host()
    counts = []
    for texture, numbers in (("noise", {"radial_1": -0.15}), ("panels", {})):
        seen = machines.sequence(texture, 1, n=4, **numbers)
        answers, n = machines.play(emulated, seen)
        assert answers == machines.play(host, seen)[0]
        assert any(answer[28] == 0 for answer in answers)  # a valid one among them
        counts.append(n)
    assert max(n[1] for n in counts) < MOST_OF_A_START
    assert max(counts[1][2:]) < MOST_INSTRUCTIONS[name]
    assert emulated.used_stack() < 8_000


def test_the_fuzzer_finds_nothing_in_a_short_time(tmp_path: Path) -> None:
    (tmp_path / "seed").write_bytes(bytes(range(256)) + bytes(8))
    command = ["build/fuzz/fuzz_vision", "-runs=600", "-max_len=264", "-len_control=0", "-seed=1", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    assert "Done 600 runs" in done.stderr


def test_pictures_that_are_there_give_the_same_readings() -> None:
    flown = motion.fly(motion.Approach(2.5, 1.5, rrev_per_s=(3.0, 6.0)), np.random.default_rng(3))
    camera = native.Camera()
    seen = native.look(camera, textures.make("dots"), flown.rows, seed=5, pictures=True)
    again = native.look(camera, textures.make("dots"), flown.rows, seed=5)
    other = native.look(camera, textures.make("dots"), flown.rows, seed=6)
    assert seen.pictures is not None
    assert native.estimate(camera, seen.pictures, flown.rows).readings.tobytes() == seen.readings.tobytes()
    assert again.readings.tobytes() == seen.readings.tobytes()
    assert other.readings.tobytes() != seen.readings.tobytes()


def test_wrong_numbers_are_refused() -> None:
    with pytest.raises(ArgumentError, match="no number 'zoom'"):
        native.Camera(zoom=2.0)
    with pytest.raises(ArgumentError, match="focal = 1"):
        native.Camera(focal=1.0)
    with pytest.raises(ArgumentError, match="no surface 'sky'"):
        textures.make("sky")
    with pytest.raises(ArgumentError, match="18 numbers a row"):
        native.look(native.Camera(), textures.make("white"), np.zeros((3, 4)))
    with pytest.raises(ArgumentError, match="power of two"):
        native.Texture(np.zeros((100, 100)), 1.0)


def test_a_picture_file_is_a_surface(tmp_path: Path) -> None:
    from matplotlib import image

    image.imsave(tmp_path / "wall.png", np.random.default_rng(1).uniform(size=(60, 90)), cmap="gray")
    flown = motion.fly(motion.Approach(2.5, 1.5, rrev_per_s=(3.0, 5.0)), np.random.default_rng(3))
    seen = native.look(native.Camera(), textures.make(str(tmp_path / "wall.png")), flown.rows)
    assert seen.valid[1:].mean() > 0.9
    (tmp_path / "none.png").write_text("no picture")
    with pytest.raises(ArgumentError, match="not a picture"):
        textures.make(str(tmp_path / "none.png"))


def test_the_command_prints_every_row() -> None:
    done = CliRunner().invoke(app, ["camera", "table", "--approaches", "2", "--json"])
    assert '"rows"' in done.stdout
    assert all(f'"{case.name}"' in done.stdout for case in study.CASES)
