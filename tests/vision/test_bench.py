"""Pictures that were taken elsewhere: the same figures from a file and from a folder, and damage is one line."""

import contextlib
import csv
import json
import shutil
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
import yaml

from ivl import cli
from ivl.camera import bench, film
from ivl.errors import ConfigError
from ivl.world import World


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A film that was rendered, as a file."""
    path = tmp_path_factory.mktemp("film") / "f.npz"
    world = World(gear_set="as_simulated", sensing="aideck60", texture="noise")
    film.write(film.shoot(world, 2.5, 60.0, 8.0, 8.0, start="flown", pictures=True), path)
    return path


@pytest.fixture(scope="module")
def whole(archive: Path) -> Path:
    """The same as a folder."""
    folder = archive.parent / "rail"
    folder.mkdir()
    data = np.load(archive)
    told = film.of_world(World(gear_set="as_simulated", sensing="aideck60", texture="noise"))
    (folder / bench.CAMERA).write_text(yaml.safe_dump({name: told[name] for name in told.names}))
    with (folder / bench.TABLE).open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(bench.COLUMNS)
        for i, (picture, row) in enumerate(zip(data["pictures"], data["rows"], strict=True)):
            matplotlib.image.imsave(folder / f"{i:04d}.png", np.repeat(picture[:, :, None], 3, axis=2))
            table.writerow([f"{i:04d}.png", *(repr(float(value)) for value in (*row[:11], *row[14:]))])
    return folder


@pytest.fixture
def folder(whole: Path, tmp_path: Path) -> Path:
    """A copy that may be damaged."""
    return Path(shutil.copytree(whole, tmp_path / "rail"))


def test_a_file_and_a_folder_of_the_same_pictures_give_the_same_readings(archive: Path, whole: Path) -> None:
    one, other = bench.read(archive), bench.read(whole)
    assert one.seen.readings.tobytes() == other.seen.readings.tobytes()
    assert bench.figures([one], "x") == bench.figures([other], "x")
    found = bench.figures([one], "x")
    assert found.valid > 0.9
    assert abs(found.bias) < 0.02
    assert found.sigma < 0.05


def test_pictures_that_say_something_else_are_seen_as_wrong(archive: Path) -> None:
    good = bench.read(archive)
    data = dict(np.load(archive))
    data["rows"][:, 3] -= 0.3  # the true vehicle is said to be farther away than its pictures show
    np.savez(archive.with_name("fast.npz"), **data)
    bad = bench.read(archive.with_name("fast.npz"))
    assert abs(bench.figures([bad], "x").bias) > abs(bench.figures([good], "x").bias) + 0.05


def test_the_command_prints_rows_and_writes_a_sensor_set_that_flies(
    archive: Path, whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ivl.camera.fit._LEAST", 20)
    out = tmp_path / "ours.yaml"
    assert cli.run(["camera", "bench", str(archive), str(whole), "--out", str(out), "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["name"] for row in rows] == ["f.npz", "rail", "all"]
    assert rows[2]["n"] == rows[0]["n"] + rows[1]["n"]
    values = World(gear_set="as_simulated", sensing=str(out)).params.values
    assert values["rrev.rate"] == pytest.approx(60.0, abs=0.5)
    assert values["rrev.noise_rel"] > 0.0


@pytest.mark.parametrize(
    ("file", "old", "new", "told"),
    [
        (bench.TABLE, "0001.png", "../x.png", "line 3: file: '../x.png': must be a name in this folder"),
        (bench.TABLE, "0001.png", "none.png", "none.png: is no picture"),
        (bench.TABLE, "told_q_w", "q_told", "column told_q_w is missing for a sequence of pictures"),
        (bench.TABLE, "0001.png,", "0001.png,9e99", "t_s"),
        (bench.CAMERA, "width: 160.0", "width: 320", "pixels, the camera has 320 x 240"),
        (bench.CAMERA, "width: 160.0", "width: wide", "width: must be a number, not 'wide'"),
        (bench.CAMERA, "width: 160.0", "breadth: 1", "a camera has no number 'breadth'"),
    ],
)
def test_damage_of_a_folder_is_one_line(folder: Path, file: str, old: str, new: str, told: str) -> None:
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new, 1))
    with pytest.raises(ConfigError, match=told.replace("(", r"\(")) as error:
        bench.read(folder)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("seed", range(40))
def test_a_damaged_file_is_refused_or_read(archive: Path, tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    data = dict(np.load(archive))
    kind = seed % 8
    if kind == 0:
        data["rows"][rng.integers(len(data["rows"])), rng.integers(18)] = rng.choice([np.nan, np.inf, -1e300])
    elif kind == 1:
        data["rows"] = data["rows"][: rng.integers(3)]
    elif kind == 2:
        data["pictures"] = data["pictures"].astype(np.float32)
    elif kind == 3:
        data["pictures"] = data["pictures"][:, 1:]
    elif kind == 4:
        data["rows"][:, 4:8] *= rng.uniform(1.2, 3.0)
    elif kind == 5:
        data["camera_focal"] = rng.choice([np.nan, -1.0, 1e9])
    elif kind == 6:
        data["rows"] = data["rows"][::-1]
    path = tmp_path / "d.npz"
    np.savez(path, **data)
    if kind == 7:
        content = bytearray(path.read_bytes())
        content[rng.integers(len(content))] ^= 1 << int(rng.integers(8))
        path.write_bytes(bytes(content))
        with contextlib.suppress(ConfigError):  # a bit of a picture may be another one, and nobody can tell
            bench.read(path)
        return
    with pytest.raises(ConfigError) as caught:
        bench.read(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
