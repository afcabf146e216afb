"""Pictures in the loop: landings that see, the film of one, its noise model, and the commands."""

import json
import pickle
import subprocess
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

import ivl
from ivl import cli, experiment, native, silproc
from ivl.camera import film, fit, video
from ivl.errors import ArgumentError, ConfigError, NativeError
from ivl.outcome import four_leg

LANDING = (2.5, 90.0, 5.05, 10.65)


def world(texture: str | None = "noise", sensing: str = "aideck60", **overrides: float) -> ivl.World:
    return ivl.World("habas2021", "wide_short", "as_simulated", sensing=sensing, texture=texture, **overrides)


def test_landings_with_pictures_land_and_do_not_depend_on_threads_registers_or_pickling() -> None:
    seeing = world("panels")
    out = seeing.rollouts(*LANDING[:2], np.full(12, LANDING[2]), LANDING[3], seed=3, start="flown", threads=1)
    assert four_leg(out).sum() >= 9
    again = pickle.loads(pickle.dumps(seeing))
    assert again.texture == "panels"
    library = native.library()
    before = library.register_bits()
    try:
        library.use_registers(128)
        other = again.rollouts(*LANDING[:2], np.full(12, LANDING[2]), LANDING[3], seed=3, start="flown", threads=3)
    finally:
        library.use_registers(before)
    assert other.tobytes() == out.tobytes()
    alone = seeing.rollouts(*LANDING, seed=3, stream=7, start="flown")
    assert alone.tobytes() == out[7].tobytes()


def test_a_film_is_the_landing_and_its_errors_are_small() -> None:
    seeing = world()
    seen = film.shoot(seeing, *LANDING, seed=3, stream=1, start="flown", pictures=True)
    out = seeing.rollouts(*LANDING, seed=3, stream=1, start="flown")
    assert seen.outcome is not None
    assert seen.outcome.t_trigger_s == out.t_trigger_s
    assert seen.seen.pictures is not None
    assert seen.seen.pictures.shape == (len(seen), 120, 160)
    # no picture is taken once the flip has begun, and the first is no later than a period after the start
    assert out.t_trigger_s - 1 / 60 < seen.t_s[-1] <= out.t_trigger_s
    assert seen.t_s[0] <= 1 / 60
    assert np.allclose(np.diff(seen.t_s), 1 / 60)
    near = seen.truth().rrev_per_s > 2.0
    assert near.sum() >= 10
    assert seen.seen.valid[near].all()
    error = seen.seen.number("rrev")[near] / seen.truth().rrev_per_s[near] - 1
    assert np.abs(error).max() < 0.06
    assert np.abs(error).max() > 1.0e-4
    # what is told of the attitude is wrong by what a gyro and a start leave
    wrong = np.abs(seen.rows[:, 14:18] - seen.rows[:, 4:8]).max()
    assert 1.0e-5 < wrong < 0.03


def test_what_cannot_be_seen_does_not_trigger() -> None:
    out = world("white").rollouts(*LANDING[:2], np.full(3, LANDING[2]), LANDING[3], start="flown")
    assert not (out.d_valid_norm > 0).any()
    assert not four_leg(out).any()


def test_the_light_is_a_number_of_the_sensor_set() -> None:
    plain = film.shoot(world(), *LANDING, start="flown", pictures=True)
    dark = film.shoot(world(**{"camera.white": 100.0}), *LANDING, start="flown", pictures=True)
    assert plain.seen.pictures is not None
    assert dark.seen.pictures is not None
    ratio = dark.seen.pictures[0].mean() / plain.seen.pictures[0].mean()
    assert ratio == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"texture": "noise", "sensing": "camera50"}, ConfigError, "camera50.yaml has no camera"),
        ({"texture": "sky"}, ArgumentError, "no surface 'sky'"),
        ({"rrev.rate": 50.0}, NativeError, "goes with neither rrev.rate"),
        ({"camera.width": 200.0}, NativeError, "must be 160 or 320"),
    ],
)
def test_what_cannot_be_is_refused(arguments: dict[str, object], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        world(**arguments)  # type: ignore[arg-type]


def test_a_fit_finds_the_model_that_made_the_readings() -> None:
    rng = np.random.default_rng(4)
    n, landings = 50, 200
    rrev = np.tile(np.linspace(0.6, 6.0, n), landings)
    noise = rng.normal(size=(landings, n))
    for k in range(1, n):
        noise[:, k] = 0.6 * noise[:, k - 1] + 0.8 * noise[:, k]
    own = np.repeat(0.01 * rng.normal(size=landings), n)
    error = np.sqrt(0.03**2 + (0.02 * rrev) ** 2) * noise.ravel() + (own - 0.005) * rrev
    wild = rng.uniform(size=error.size) < 0.01
    error[wild] += (np.where(rng.uniform(size=error.size) < 0.5, 0.8, -0.8) * rrev)[wild]
    errors = fit.Errors(
        np.repeat(np.arange(landings), n), np.tile(np.arange(n), landings), rng.uniform(size=error.size) > 0.05,
        rrev, error, np.ones(error.size), np.zeros(error.size),
    )  # fmt: skip
    found = fit.of_errors(errors, 60.0, 0.022).numbers
    assert found["noise"] == pytest.approx(0.03, rel=0.25)
    assert found["noise_rel"] == pytest.approx(0.02, rel=0.25)
    assert found["mean_rel"] == pytest.approx(-0.005, abs=0.002)
    assert found["bias_rel"] == pytest.approx(0.01, rel=0.35)
    assert found["correlation"] == pytest.approx(0.6, abs=0.1)
    assert found["outlier"] == pytest.approx(0.01, rel=0.3)
    assert found["outlier_rel"] == pytest.approx(0.8, rel=0.1)
    assert found["drop"] == pytest.approx(0.05, rel=0.2)


def test_the_command_draws_a_picture_and_a_video(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plot, frames = tmp_path / "p.png", tmp_path / "f.mp4"
    words = ["rollout", "--sensing", "aideck60", "--texture", "panels", "--plot", str(plot), "--frames", str(frames)]
    assert cli.run([*words, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["four_leg"]
    assert plot.stat().st_size > 10_000
    decoder = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-i", str(frames)]
    decoded = subprocess.run([*decoder, "-f", "rawvideo", "-pix_fmt", "gray", "-"], capture_output=True, check=True)
    assert 30 < len(decoded.stdout) / 640**2 < 70
    assert cli.run([*words[:5], "--frames", str(tmp_path / "f.npz"), "--seed", "2"]) == 0
    assert np.load(tmp_path / "f.npz")["pictures"].shape[1:] == (120, 160)


def test_a_short_film_is_a_moving_picture(tmp_path: Path) -> None:
    seen = film.shoot(world(), 2.5, 90.0, 1.5, 8.0, pictures=True)
    video.write(seen, tmp_path / "f.gif")
    with Image.open(tmp_path / "f.gif") as moving:
        assert moving.n_frames == len(seen)  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--sensing", "aideck60", "--frames", "f.avi"], "unknown kind of file (allowed .mp4, .gif, .npz)"),
        (["--sensing", "camera50", "--frames", "f.mp4"], "there is no camera that takes pictures"),
        (["--sensing", "camera50", "--texture", "noise"], "has no camera that looks at it"),
        (["--sensing", "aideck60", "--texture", "sky"], "noise, dots, low_contrast, panels, checks, white, lines"),
        (["--sensing", "aideck60", "--speed", "2"], "--moment is missing"),
    ],
)
def test_options_that_make_no_sense_are_refused(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    more = [] if "--speed" in words else ["--rrev", "5", "--moment", "8", "--speed", "2.5", "--angle", "90"]
    more += ["--rrev", "5"] if "--speed" in words else []
    assert cli.run(["rollout", *words, *more]) == 2
    assert message in " ".join(capsys.readouterr().err.split())


def test_the_software_vehicle_has_no_pictures() -> None:
    with pytest.raises(ConfigError, match="pictures are rendered in process only"):
        silproc.SilProcess(world())


def test_the_shipped_experiment_flies_pictures() -> None:
    chosen = experiment.load("experiments/onboard_camera.yaml")
    assert (chosen.sensing, chosen.texture) == ("aideck60", "panels")
    assert chosen.make_world().texture == "panels"
