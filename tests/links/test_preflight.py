"""Each check of the preflight fails when what it looks at is wrong, and then alone; and the commands around it."""

import json
from collections.abc import Callable, Iterator

import pytest

from ivl import experiment, native
from ivl.cli import run
from ivl.errors import RolloutError
from ivl.experiment import Experiment
from ivl.links import preflight, tracking
from ivl.links.tables import Session
from ivl.links.vehicle import Vehicle
from ivl.mocap import config as mocap_config
from ivl.native import Field, NativeLibrary
from ivl.silproc import SilProcess
from ivl.site import file as site_file
from ivl.world import World


@pytest.fixture
def vehicle(server: SilProcess) -> Iterator[Vehicle]:
    with Session(server.uri) as session:
        yield Vehicle(session)


def failed(vehicle: Vehicle, chosen: Experiment | None = None) -> list[str]:
    return [check.name for check in preflight.checks(vehicle, chosen) if not check.ok]


def test_vehicle_on_the_floor_is_fit_and_wants_its_configuration(vehicle: Vehicle) -> None:
    chosen = experiment.load("experiments/paper_vertical.yaml", ["firmware.flip_s_max=0.9"])
    assert failed(vehicle, chosen) == ["configuration"]
    vehicle.configure(chosen.make_world())
    assert failed(vehicle, chosen) == []


@pytest.mark.parametrize(
    ("name", "value", "check"),
    [
        ("stabilizer.controller", 1, "stabilizer.controller"),
        ("motorPowerSet.enable", 1, "motorPowerSet.enable"),
        ("sil.vbat", 3.5, "battery"),
        ("stabilizer.stop", 1, "supervisor"),
    ],
)
def test_check_fails_when_the_vehicle_is_not_fit(
    server: SilProcess, vehicle: Vehicle, name: str, value: float, check: str
) -> None:
    server.set(name, value)
    vehicle.wait_in_wall_time(lambda: False, 0.5)
    assert failed(vehicle) == [check]


def test_check_of_the_link_fails_when_packets_are_lost(server: SilProcess, vehicle: Vehicle) -> None:
    server.set("fault.loss", 0.3)
    check = preflight.link(vehicle)
    server.set("fault.loss", 0.0)
    assert not check.ok
    assert "pings lost" in check.found


def test_check_of_the_estimator_ends_in_time_when_no_pose_comes(
    server: SilProcess, vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch
) -> None:
    server.set("sil.pose_source", 1)
    monkeypatch.setattr(preflight, "SIGMA_S", 0.3)
    vehicle.wait(lambda: vehicle.position_sigma_m > preflight.SIGMA_M_MAX, 20.0, "uncertainty")
    assert not preflight.estimator(vehicle).ok


def test_check_of_the_tables_names_what_differs(vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch) -> None:
    layout: Callable[..., tuple[dict[str, Field], object]] = NativeLibrary.layout

    def other(self: NativeLibrary, code: int) -> tuple[dict[str, Field], object]:
        fields, dtype = layout(self, code)
        extra = Field("ivl.colour", "f4", 0, 1, "1", 0.0, 1.0, 0.0, "of another version")
        return ({**fields, "ivl.colour": extra} if code == native.LAYOUT_CONFIG else fields), dtype

    monkeypatch.setattr(NativeLibrary, "layout", other)
    check = preflight.tables(vehicle)
    assert not check.ok
    assert "ivl.colour" in check.found


# ---- the commands


def test_doctor_prints_a_table_and_json_and_tells_by_its_exit_code(
    server: SilProcess, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["doctor", "--uri", server.uri, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["fit"] is True
    assert {"tables", "link", "supervisor", "battery", "estimator"} <= {check["name"] for check in result["checks"]}
    server.set("sil.vbat", 3.4)
    assert run(["doctor", "--uri", server.uri]) == 1
    text = capsys.readouterr().out
    assert "FAIL" in text
    assert "PASS" in text


def test_fly_prints_snapshot_and_outcome_and_writes_the_recorder(
    server: SilProcess, capsys: pytest.CaptureFixture[str], tmp_path: object
) -> None:
    csv = f"{tmp_path}/landing.csv"
    command = ["fly", "--uri", server.uri, "--rrev-c", "4.8", "--moment", "8", "--csv", csv, "--json"]
    assert run(command) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["outcome"]["n_legs"] == 4
    assert result["snapshot"]["triggered"] is True
    with open(csv, encoding="utf-8") as file:  # noqa: PTH123
        assert len(file.readlines()) == 449


@pytest.mark.parametrize(
    ("command", "code", "message"),
    [
        (["doctor", "--uri", "radio://0/80/2M/E7E7E7E7E7"], 1, "no Crazyradio is plugged in"),
        (["fly", "--uri", "udp://127.0.0.1:9", "--rrev", "4", "--moment", "8"], 1, "nobody listens there"),
        (["learn", "experiments/paper_vertical.yaml", "--uri", "radio://0/80/2M/E7E7E7E7E7"], 2, "ivl site new"),
        (["doctor", "--uri", "http://x"], 2, "names no link"),
        (["doctor", "--uri", "serial://nowhere"], 1, "there is no such serial port"),
    ],
)
def test_missing_link_is_one_line_and_an_exit_code(
    capsys: pytest.CaptureFixture[str], command: list[str], code: int, message: str
) -> None:
    assert run(command) == code
    captured = capsys.readouterr()
    assert captured.out == ""
    assert message in captured.err
    assert len(captured.err.splitlines()) == 1


def test_motors_that_the_image_is_too_weak_for_are_refused_with_what_to_do(server: SilProcess) -> None:
    stronger = World("habas2021", **{"rotor.thrust_max": 0.2})
    with Session(server.uri) as session, pytest.raises(RolloutError, match=r"motor_thrust_max.*make -C firmware"):
        Vehicle(session).configure(stronger)


def test_the_cameras_of_a_site_see_the_vehicle_at_home(server: SilProcess, in_room: Experiment) -> None:
    """Limits are wide: on a busy machine cameras in real time are late."""
    limits = {"lost_s": 0.7, "frozen_s": 0.7, "settle_s": 0.75, "rate_hz_min": 1.0, "jitter_ms_max": 1000.0}
    cameras = mocap_config.load("simulator").model_copy(update=limits)
    assert in_room.site is not None
    room = site_file.load(in_room.site)
    with Session(server.uri) as session:
        vehicle = Vehicle(session)
        assert list(tracking.site_checks(vehicle, room)) == [], "somebody else tells the vehicle its poses"
        for home_m, ok in (((0.0, 0.0), True), ((0.5, 0.0), False)):
            place = room.model_copy(update={"mocap": cameras, "home_m": home_m})
            found = {check.name: check.ok for check in tracking.site_checks(vehicle, place)}
            assert found == {"motion capture": True, "estimate": True, "home": ok}
