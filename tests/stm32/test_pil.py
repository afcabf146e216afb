"""Processor in the loop: the world flies on the decisions of the emulated chip, and nothing changes."""

import json
import sys
from pathlib import Path

import numpy as np
import policies
import pytest
import yaml

import ivl
from ivl import experiment, run
from ivl.cli import run as cli
from ivl.errors import ConfigError, RolloutError
from ivl.layout import layout_of
from ivl.learning.loop import LearningRun
from ivl.links import open_source, pil
from ivl.native import library
from ivl.policy import file
from ivl.source import Plan, WorldSource
from ivl.store import RunStore

GEARS = ("extra_narrow_short", "narrow_short", "wide_short", "extra_narrow_long", "narrow_long", "wide_long")
EXPERIMENT = "experiments/paper_vertical.yaml"


@pytest.fixture(scope="module")
def chips() -> pil.Chips:
    return pil.Chips(pil.qemu_command(pil.IMAGE))


@pytest.mark.parametrize("gear", GEARS)
@pytest.mark.parametrize("start", ["imparted", "flown"])
def test_landings_have_the_same_bits_in_the_loop(chips: pil.Chips, gear: str, start: str) -> None:
    noise = {"sense.latency": 0.01, "sense.velocity_noise": 0.03, "sense.gyro_noise": 0.05}
    here, there = (ivl.World("habas2021", gear, "as_simulated", **noise) for _ in range(2))
    chips.attach(there)
    before = chips.n_ticks
    rng = np.random.default_rng(3)
    policies = rng.uniform(3.0, 6.0, 8), rng.uniform(4.0, 11.0, 8)
    wanted = here.rollouts(2.5, 70.0, *policies, start=start, seed=4)
    found = there.rollouts(2.5, 70.0, *policies, start=start, seed=4, threads=1)
    chips.check()
    assert found.tobytes() == wanted.tobytes()
    assert chips.n_ticks - before > 8 * 50


def test_each_thread_has_a_chip_and_bits_do_not_depend_on_their_number() -> None:
    chips = pil.Chips(pil.qemu_command(pil.IMAGE))
    there = ivl.World()
    chips.attach(there)
    moments = np.linspace(5.0, 10.0, 40)
    one = there.rollouts(2.5, 90.0, 4.8, moments, threads=1)
    three = there.rollouts(2.5, 90.0, 4.8, moments, threads=3)
    chips.check()
    assert one.tobytes() == three.tobytes() == ivl.World().rollouts(2.5, 90.0, 4.8, moments).tobytes()
    assert 1 <= chips.n_chips <= 3


def test_policy_that_the_core_refuses_is_refused_by_the_chip(chips: pil.Chips) -> None:
    strict = {"firmware.flip_moment_max": 0.005}
    here, there = (ivl.World(**strict) for _ in range(2))
    chips.attach(there)
    found = there.rollouts(2.5, 90.0, 4.8, [4.0, 8.0])
    assert found.tobytes() == here.rollouts(2.5, 90.0, 4.8, [4.0, 8.0]).tobytes()
    assert there.end_reason(found.end_reason[1]) == "refused"


def test_learning_in_the_loop_ends_with_the_same_policy_bit_for_bit(tmp_path: Path) -> None:
    chosen = experiment.load(EXPERIMENT, ["budget=80"])
    runs = []
    for name, uri in (("sil", None), ("pil", "pil://")):
        source = open_source(uri, chosen) if uri else WorldSource(chosen.make_world(), chosen)
        runs.append(_learn(chosen, source, tmp_path / name))
    (history, rollouts), (history_pil, rollouts_pil) = runs
    assert len(rollouts.outcomes) == 80
    assert rollouts_pil.outcomes.tobytes() == rollouts.outcomes.tobytes()
    assert rollouts_pil.theta.tobytes() == rollouts.theta.tobytes()
    assert history_pil == history


def _learn(chosen, source, folder):
    manifest = run.make_manifest(chosen, chosen.make_world(), None)
    with RunStore.create(folder, chosen.to_yaml(), manifest, library().outcome_dtype, layout_of(chosen)) as store:
        LearningRun([chosen], source, store).run()
        return store.episodes(), store.rollouts()


def test_a_flip_is_recorded_as_in_process() -> None:
    chosen = experiment.load("experiments/paper_flight.yaml", learner="ephe_robust")
    theta = np.array([[4.0, 8.0], [4.3, 9.0]])
    plan = Plan(theta, np.array([1, 2**40], dtype=np.uint64), np.array([0, 9], dtype=np.uint64))
    there = list(open_source("pil://", chosen, record=True).fly(plan))
    here = list(WorldSource(chosen.make_world(), chosen, record=True).fly(plan))
    assert there[0].recordings is not None
    assert here[0].recordings is not None
    assert np.isfinite(here[0].recordings).any(axis=1).all()
    assert there[0].recordings.tobytes() == here[0].recordings.tobytes()
    assert next(open_source("pil://", chosen).fly(plan)).recordings is None


def test_uri_may_name_another_image(tmp_path: Path) -> None:
    image = tmp_path / "other.elf"
    image.write_bytes(pil.IMAGE.read_bytes())
    chosen = experiment.load(EXPERIMENT)
    source = open_source(f"pil://{image}", chosen)
    plan = Plan(np.array([[4.8, 8.0]]), np.array([1], dtype=np.uint64), np.array([0], dtype=np.uint64))
    (flown,) = source.fly(plan)
    (wanted,) = WorldSource(chosen.make_world(), chosen).fly(plan)
    assert flown.outcomes.tobytes() == wanted.outcomes.tobytes()


@pytest.mark.parametrize("uri", ["pi://", "pil:", "nothing", "pil:///no/such/image.elf"])
def test_uri_that_makes_no_sense_is_a_wrong_configuration(uri: str) -> None:
    with pytest.raises(ConfigError, match=r"allowed pil://|image\.elf is missing: run `make firmware`"):
        open_source(uri, experiment.load(EXPERIMENT))


def test_missing_emulator_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(pil.QEMU_ENV, "no-such-emulator")
    with pytest.raises(RolloutError, match=r"no-such-emulator is not installed \(Debian: qemu-system-arm"):
        open_source("pil://", experiment.load(EXPERIMENT))


@pytest.mark.parametrize(
    ("script", "message"),
    [
        ("pass", "has ended; its exit code is 0"),
        ("raise SystemExit(117)", "has ended; its exit code is 117"),
        ("import os; os.write(1, bytes(32)); os.read(0, 1)", "of another version"),
        ("import os; os.kill(os.getpid(), 11)", "signal 11 ended it"),
    ],
)
def test_program_that_is_no_chip_is_refused(script: str, message: str) -> None:
    with pytest.raises(RolloutError, match=message):
        pil.Chips([sys.executable, "-c", script])


def test_program_that_cannot_be_started_is_refused() -> None:
    with pytest.raises(RolloutError, match="cannot be started"):
        pil.Chips(["/no/such/program"])


RELAY = """
import subprocess, sys
chip = subprocess.Popen(sys.argv[2:], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
out, size = sys.stdout.buffer, int.from_bytes((hello := chip.stdout.read(32))[8:12], "little")
reply = int.from_bytes(hello[12:16], "little")
out.write(hello); out.flush()
for _ in range(int(sys.argv[1])):
    request = sys.stdin.buffer.read(size)
    chip.stdin.write(request); chip.stdin.flush()
    answer = bytearray(chip.stdout.read(reply))
    out.write(answer); out.flush()
chip.kill()
"""


def test_chip_that_fails_in_flight_voids_the_batch() -> None:
    chosen = experiment.load(EXPERIMENT)
    source = pil.PilSource("pil://", chosen, threads=1)
    failing = [sys.executable, "-c", RELAY, "300", *pil.qemu_command(pil.IMAGE)]
    source.chips = pil.Chips(failing)
    source.chips.attach(source.world)
    plan = Plan(np.full((8, 2), (4.8, 8.0)), np.arange(8, dtype=np.uint64), np.zeros(8, dtype=np.uint64))
    with pytest.raises(RolloutError, match="the emulated chip has ended; its exit code is 0"):
        list(source.fly(plan))


def test_command_line_learns_in_the_loop(small_pil: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    results = []
    for name, extra in (("sil", []), ("pil", ["--uri", "pil://"])):
        assert cli(["learn", str(small_pil), "--json", "--out", str(tmp_path / name), *extra]) == 0
        results.append(json.loads(capsys.readouterr().out) | {"run_dir": ""})
    assert results[0] == results[1]


@pytest.fixture
def small_pil(tmp_path: Path) -> Path:
    """The paper's experiment, shorter, judged on a grid of a few points."""
    path = tmp_path / "small.yaml"
    check = {
        "n_fresh": 10,
        "effort": 0.01,
        "grid": {
            "rrev_c_per_s": {"lo": 4.5, "hi": 5.0, "step": 0.25},
            "moment_y_Nmm": {"lo": 7.0, "hi": 9.0, "step": 1.0},
        },
    }
    data = yaml.safe_load(experiment.load(EXPERIMENT, ["budget=16"], learner="ephe_robust").to_yaml()) | {
        "check": check
    }
    path.write_text(yaml.safe_dump(data))
    return path


def test_bench_tells_the_speed_against_real_time(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli(["bench", "--no-mujoco", "--pil", "--rollouts", "100", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["pil_times_real_time"] == pytest.approx(result["pil_ticks_per_s"] * 0.002)
    assert result["pil_times_real_time"] > 1.0


@pytest.mark.parametrize(("speed", "no_go"), [("0.6", 1), ("2.5", 0)])
def test_a_policy_for_every_approach_is_flown_by_the_chip(
    speed: str, no_go: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "g.yaml"
    file.save(policies.by_hand(), path)
    words = ["--policy", str(path), "--speed", speed, "--angle", "60", "--json"]
    assert cli(["fly", "--uri", "pil://", *words]) == 0
    told = json.loads(capsys.readouterr().out)
    assert cli(["rollout", *words]) == 0
    assert told["outcome"] == json.loads(capsys.readouterr().out)
    assert told["outcome"]["no_go"] == no_go
    assert told["snapshot"]["triggered"] is (no_go == 0)
