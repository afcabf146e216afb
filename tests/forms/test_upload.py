"""A policy of 64 parameters travels in 16 packets, over a bad link too; forms that differ are refused in one line."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from form_six import BUILDS, ROOT, policy_most

from ivl import experiment, forms
from ivl.experiment import Experiment
from ivl.forms import Form
from ivl.links import crazyflie
from ivl.links.clock import COARSE, LockStep
from ivl.links.crazyflie import CrazyflieSource
from ivl.links.packets import PacketType
from ivl.links.tables import Session
from ivl.links.vehicle import OtherForms, Vehicle
from ivl.silproc import SilProcess
from ivl.world import World

PRODUCT = {
    "IVL_NATIVE_LIBRARY": ROOT / "host" / "ivl" / "_native" / "libivl_sil.so",
    "IVL_NATIVE_SERVER": ROOT / "host" / "ivl" / "_native" / "ivl_sil",
}


@pytest.fixture
def most() -> Form:
    return forms.by_name("most")


def thetas(form: Form, n: int) -> np.ndarray:
    """Policies all over the form's ranges, shape (n, 64)."""
    lo, hi = np.array([[p.lo, p.hi] for p in form.params]).T
    return np.random.default_rng(1).uniform(lo, hi, (n, form.n))


FAULTS = (
    {},
    {"loss": 0.2},
    {"duplicate": 0.3, "reorder": 0.3},
    {"loss": 0.1, "duplicate": 0.2, "reorder": 0.2, "jitter_ms": 3.0},
)


@pytest.mark.parametrize("faults", FAULTS, ids=lambda faults: "+".join(faults) or "good")
def test_it_is_in_force_once_with_its_checksum(most: Form, faults: dict[str, float]) -> None:
    world = World("habas2021", "wide_short", "as_simulated")
    with SilProcess(world) as server:
        session = Session(server.uri)
        clock = LockStep(session, COARSE)
        vehicle = Vehicle(session, clock)
        try:
            vehicle.configure(world)
            for name, value in {**faults, "seed": 5}.items():
                server.set(f"fault.{name}", value)
            in_force = [0]
            for theta in thetas(most, 4):
                number = vehicle.put_policy(most, theta)
                echo = vehicle._echo[PacketType.POLICY_ECHO]
                told = (echo["seq_in_force"], echo["crc_in_force"], echo["form_in_force"])
                assert told == (number, most.crc(theta), most.number)
                for _ in range(5):  # what the link has held back arrives, and changes nothing
                    assert server.get("ivl.policy_seq") == number not in in_force
                    assert server.get("ivl.policy_crc") == most.crc(theta)
                    vehicle.pause(0.1)
                begins = np.float32([server.get(f"ivl.theta{i}") for i in range(4)])
                assert begins.tolist() == np.float32(most.to_si(theta)[:4]).tolist()
                in_force.append(number)
            assert server.get("ivl.n_refused") == 0
            assert not faults or server.get("fault.n_lost") + server.get("fault.n_reordered") > 0
            for name in faults:
                server.set(f"fault.{name}", 0)
        finally:
            clock.close()
            session.close()


def test_it_lands_over_a_link_with_the_bits_of_this_process(six: Experiment, most: Form) -> None:
    chosen = experiment.from_data(six.model_dump(mode="json") | {"policy": policy_most(most.names)}, "most.yaml")
    theta = (*np.random.default_rng(2).uniform(4.0, 5.6, 63).tolist(), 8.0)
    with SilProcess(chosen.make_world()) as server, CrazyflieSource(server.uri, chosen) as source:
        server.set("fault.loss", 0.1)
        landing = source.fly_one(crazyflie.Rollout(theta, seed=1, stream=2))
        server.set("fault.loss", 0)
    wanted = chosen.make_world().rollouts(2.5, 90.0, *theta, form="most", seed=1, stream=2)
    assert landing.outcome.tobytes() == wanted.tobytes()
    assert landing.snapshot.policy_seq == landing.policy_seq


# ---- forms that differ


def fly_as(builds: dict[str, Path], *arguments: str) -> subprocess.CompletedProcess[str]:
    """`ivl fly` of a host with other builds."""
    command = [sys.executable, "-m", "ivl", "fly", *arguments]
    environment = {**os.environ, **{name: str(path) for name, path in builds.items()}}
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=False)


def test_a_vehicle_without_the_form_is_refused_in_one_line(
    six: Experiment, six_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("IVL_NATIVE_SERVER", str(PRODUCT["IVL_NATIVE_SERVER"]))
    with SilProcess(six.make_world()) as server:
        done = fly_as(BUILDS, str(six_file), "--uri", server.uri, "--theta", "4.8,0,0,8,0,9")
        assert server.get("sil.lockstep") == 0, "time must pass for whoever comes next"
        assert server.get("sil.episode") == 0, "nothing was flown"
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert "the vehicle does not have the policy form six of this host" in line
    assert "its firmware does not have this form of policies" in line


def test_a_form_of_the_same_length_but_another_name_is_told_by_its_checksum(
    six: Experiment, monkeypatch: pytest.MonkeyPatch
) -> None:
    crc = Form.crc
    with SilProcess(six.make_world()) as server:
        with monkeypatch.context() as patch:
            patch.setattr(Form, "crc", lambda form, theta: crc(form, theta) ^ 1)
            with pytest.raises(OtherForms, match=r"policy form six of this host \(what arrived does not have"):
                CrazyflieSource(server.uri, six)
        with CrazyflieSource(server.uri, six) as source:
            assert source.n_discarded == 0


def test_a_host_without_the_form_is_told_which_there_are(six_file: Path) -> None:
    done = fly_as(PRODUCT, str(six_file), "--uri", "udp://127.0.0.1:9", "--theta", "4.8,0,0,8,0,9")
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "six.yaml: policy form 'six' is unknown (allowed constant, polynomial2" in line
