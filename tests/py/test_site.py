"""Site files: what they refuse, what they set of a flight, and who may fly without one."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ivl import cli, experiment, model, references, run, yamlfile
from ivl.errors import ConfigError
from ivl.mocap.frame import FlightFrame
from ivl.mocap.watch import Pose
from ivl.site import checks, place, require
from ivl.site import file as site_file
from ivl.site.file import MEASURED, SiteFile
from ivl.startpoint import start_point
from ivl.world import rotation

FLIGHT = "experiments/paper_flight.yaml"
Change = Callable[[dict[str, Any]], None]


def measured(data: dict[str, Any]) -> None:
    data["not_measured"] = []


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., str]:
    """Write the example with changes; its path."""

    def write(*changes: Change, name: str = "lab.yaml") -> str:
        data = yamlfile.read(site_file.TEMPLATE)
        for change in changes:
            change(data)
        path = tmp_path / name
        path.write_text(yamlfile.dump(data))
        return str(path)

    return write


def put(path: str, value: Any) -> Change:
    """A change of one field; a value of `...` removes it."""

    def change(data: dict[str, Any]) -> None:
        *parents, last = path.split(".")
        for parent in parents:
            data = data[parent]
        if value is ...:
            del data[last]
        else:
            data[last] = value

    return change


# ---- the file


def test_a_belief_in_a_room_knows_any_battery_of_the_day(
    write: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[tuple[dict[str, float], bool]] = []
    monkeypatch.setattr(
        run.Simulator, "of", lambda kin, flight, **_: made.append((dict(kin.world.params.values), flight.battery_lasts))
    )
    there = experiment.load(FLIGHT, [], site=write(measured))
    for in_room in (False, True):
        run.simulator_of(there, in_room=in_room)
    (home, lasts), (room, lasts_in_room) = made
    assert (lasts, lasts_in_room) == (False, True)
    assert room["battery.voltage"] == pytest.approx((4.2 + 3.7) / 2)
    even = np.random.default_rng(1).uniform(3.7, 4.2, 100_000)
    assert room["battery.voltage_scatter"] == pytest.approx(even.std(), rel=0.01)
    assert {name for name in home if home[name] != room[name]} == {"battery.voltage", "battery.voltage_scatter"}
    mains = experiment.load(FLIGHT, ["battery.voltage=0", "battery.voltage_scatter=0"], site=write(measured))
    run.simulator_of(mains, in_room=True)
    assert made[-1] == (mains.nominal_world_of(mains.gear).params.values, False)


def test_new_file_loads_as_it_is_and_check_names_every_placeholder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.run(["site", "new", "lab.yaml"]) == 0
    site = site_file.load("lab.yaml")
    assert tuple(site.not_measured) == MEASURED
    assert (tmp_path / "lab.yaml").read_bytes() == site_file.TEMPLATE.read_bytes()
    capsys.readouterr()
    assert cli.run(["site", "check", "lab.yaml", FLIGHT, "--json"]) == 1
    found = json.loads(capsys.readouterr().out)["checks"]
    (failed,) = (check for check in found if not check["ok"])
    assert failed["found"] == f"not measured yet: {', '.join(MEASURED)}"
    assert sum("ASSUMED" in check["found"] for check in found) == 2
    assert cli.run(["site", "check", "lab.yaml"]) == 1
    assert "FAIL" in capsys.readouterr().out
    assert cli.run(["site", "new", "lab.yaml"]) == 2
    assert "is there already" in capsys.readouterr().err


def test_every_field_of_the_file_is_in_the_example_with_its_meaning() -> None:
    told = site_file.TEMPLATE.read_text(encoding="utf-8")
    own = [path for path in yamlfile.paths(SiteFile) if not path.startswith("mocap.")]
    assert [path for path in own if f"{path.rpartition('.')[2]}:" not in told] == []
    fields = yamlfile.paths(SiteFile)
    assert [name for name in MEASURED if name not in fields] == []


@pytest.mark.parametrize(
    ("path", "value", "told"),
    [
        ("surface.height_m", 0.4, "surface.height_m: value 0.4: .*greater than or equal to 0.5"),
        ("surface.height_m", "2.1", "in quotes this is text"),
        ("surface.height_m", math.nan, "surface.height_m: value nan: .*finite"),
        ("surface.heading_deg", 181.0, "surface.heading_deg: value 181"),
        ("surface.landing_point_m", [0.0], "surface.landing_point_m"),
        ("surface.landing_point_m", [0.0, math.inf], "surface.landing_point_m.1"),
        ("surface.left_m", -1.0, "surface.left_m: value -1"),
        ("fence.x_m", [1.0, 1.0], "fence.x_m: .*first number must be below the second"),
        ("fence.z_m", [-0.1, 200.0], "fence.z_m.1: value 200"),
        ("fence.z_m", ..., "fence.z_m: is missing"),
        ("battery.rest_V_min", 4.3, r"battery.rest_V_min: value 4.3 V \(allowed below full_V 4.2 V\)"),
        ("battery.load_V_min", 3.2, r"battery.load_V_min: value 3.2 V \(allowed below hover_V_min 3.2 V\)"),
        ("cues.latency_s", 0.3, "cues.latency_s"),
        ("judge", "me", "judge: value 'me'"),
        ("stop", "drop", "stop: value 'drop'"),
        ("name", "a room", "name: value 'a room'"),
        ("mocap.system", "vicom", "mocap.system: value 'vicom'"),
        ("not_measured", ["surface.hight_m"], "'surface.hight_m' is no field that is measured, did you mean"),
        ("celing", 1.0, "celing: unknown key"),
    ],
)
def test_a_wrong_field_is_one_line_with_file_field_and_what_is_allowed(
    write: Callable[..., str], path: str, value: Any, told: str
) -> None:
    with pytest.raises(ConfigError, match=rf"^lab\.yaml: .*{told}") as error:
        site_file.load(write(put(path, value)))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("turned", [put("surface.heading_deg", 3.0), put("surface.landing_point_m", [0.1, 0.0])])
def test_poses_of_others_cannot_be_turned(write: Callable[..., str], turned: Change) -> None:
    site_file.load(write(put("mocap", None)))
    with pytest.raises(ConfigError, match="without mocap nobody here turns the poses"):
        site_file.load(write(put("mocap", None), turned))


# ---- what it sets


def test_an_experiment_at_a_site_has_its_room_and_the_simulator_too(write: Callable[..., str]) -> None:
    path = write(put("surface.height_m", 2.4), put("cues.latency_s", 0.017), put("fence.y_m", [-0.9, 1.1]))
    there = experiment.load(FLIGHT, site=path)
    values = there.make_world().params.values
    record, _ = there.make_world().native_model.config()
    assert values["world.ceiling_height"] == 2.4
    assert values["sense.latency"] == 0.017
    assert values["world.sensed_gap_offset"] == model.load_vehicle("crazyflie21").quantities[
        "world.sensed_gap_offset"
    ].value  # fmt: skip
    assert float(record["ivl.h_ceil"][0]) == pytest.approx(2.417)
    assert float(record["ivl.fence_y_min"][0]) == pytest.approx(-0.9)
    assert float(record["ivl.fence_z_max"][0]) == pytest.approx(2.2)
    assert there.overrides["world.ceiling_height"].source == "site lab"
    assert place.at(there, site_file.load(path), "lab.yaml") == there


def test_an_override_that_says_otherwise_is_refused(write: Callable[..., str]) -> None:
    with pytest.raises(ConfigError, match=r"lab.yaml: .* overrides world.ceiling_height with 3 m \(allowed 2.1"):
        experiment.load(FLIGHT, ["world.ceiling_height=3.0"], site=write())


def test_a_run_keeps_the_site_and_the_vehicle_that_it_names(write: Callable[..., str], tmp_path: Path) -> None:
    shipped = Path(model.__file__).parent / "vehicles" / "crazyflie21.yaml"
    (tmp_path / "mine.yaml").write_bytes(shipped.read_bytes())
    there = experiment.load(FLIGHT, site=write(put("vehicle", "mine.yaml")))
    assert there.vehicle == str(tmp_path / "mine.yaml")
    packed, copies = references.pack(there)
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    references.save(copies, folder)
    (folder / "config.yaml").write_text(packed.to_yaml())
    (tmp_path / "mine.yaml").unlink()
    (tmp_path / "lab.yaml").unlink()
    data = yamlfile.read(folder / "config.yaml")
    references.resolve(data, folder)
    again = experiment.from_data(data, "config.yaml")
    moved = packed.model_copy(update={"vehicle": again.vehicle})
    assert again.make_world().params.values == moved.make_world().params.values
    assert references.pack(again)[0].to_yaml() == packed.to_yaml()


def test_frame_turns_poses_of_the_tracking_system_into_the_flight_frame(write: Callable[..., str]) -> None:
    site = site_file.load(write(put("surface.landing_point_m", [1.0, -2.0]), put("surface.heading_deg", 120.0)))
    frame = FlightFrame(site.surface.landing_point_m, site.heading_rad)
    rng = np.random.default_rng(5)
    for _ in range(20):
        x_m, y_m, z_m = rng.uniform(-3.0, 3.0, 3)
        q = rng.normal(size=4)
        q /= np.linalg.norm(q)
        pose = Pose((*site.to_tracking(x_m, y_m), z_m), tuple(q.tolist()))
        seen = frame.into(pose)
        assert seen.p_W_m == pytest.approx((x_m, y_m, z_m))
        turn = np.array([[math.cos(a := site.heading_rad), math.sin(a), 0], [-math.sin(a), math.cos(a), 0], [0, 0, 1]])
        assert rotation(np.array(seen.q_WB)) == pytest.approx(turn @ rotation(q), abs=1e-12)
    still = Pose((0.1, 0.2, 0.3), (0.0, 0.0, 0.6, 0.8))
    assert FlightFrame().into(still) is still


# ---- whether it fits


def failed(path: str, *settings: str, flight: str = FLIGHT) -> set[str]:
    site, there = site_file.load(path), experiment.load(flight, list(settings), site=path)
    return {check.name for check in checks.checks(site, there) if not check.ok}


@pytest.mark.parametrize(
    ("changes", "settings", "names"),
    [
        ([], [], set()),
        ([put("fence.z_m", [-0.2, 2.09])], [], {"ceiling inside fence"}),
        ([put("fence.z_m", [0.0, 2.3])], [], {"ceiling inside fence"}),
        ([put("surface.height_m", 2.5)], [], {"ceiling inside fence"}),
        ([put("home_m", [-1.9, 0.0])], [], {"places inside fence"}),
        ([put("emergency_m", [0.0, 1.1])], [], {"places inside fence"}),
        ([put("fence.x_m", [-2.0, 0.1])], [], {"places inside fence", "runway"}),
        ([put("mocap", {"system": "simulator", "body": "cf21"})], [], {"tracking"}),
        ([put("surface.height_m", 1.9)], [], {"runway"}),
        ([], ["angle_deg=30.0"], set()),
        ([], ["angle_deg=30.0", "speed_mps=3.0"], {"runway"}),
        ([put("surface.before_m", 0.06)], ["angle_deg=45.0"], {"board"}),
        ([put("surface.right_m", 0.06)], [], {"board"}),
        ([put("battery.rest_V_min", 3.25)], ["speed_mps=2.5", "body.mass=0.042"], {"thrust"}),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_named_and_nothing_else(
    write: Callable[..., str], changes: list[Change], settings: list[str], names: set[str]
) -> None:
    assert failed(write(measured, *changes), *settings) == names


def test_thrust_at_a_voltage_is_that_of_the_simulated_vehicle(write: Callable[..., str]) -> None:
    """A saturated climb in the simulator, straight up, at a fixed voltage."""
    there = experiment.load(FLIGHT, ["world.sensed_gap_offset=0.0"], site=write(measured))
    world = there.make_world()
    assert checks.thrust_N(world, 3.84) == pytest.approx(0.518, abs=0.02)  # MODEL: at 3.11 V under load 0.518 N
    values = world.params.values
    for volts in (3.3, 3.7, 4.2):
        found_N = checks.thrust_N(world, volts)
        loaded_V = volts - values["battery.sag"] * found_N
        scale = 1 + values["battery.speed_slope"] * (loaded_V / values["battery.rated_voltage"] - 1)
        assert found_N == pytest.approx(4 * values["rotor.thrust_max"] * scale**2)
    assert checks.thrust_N(world.changed(**{"battery.voltage": 0.0, "battery.voltage_scatter": 0.0}), 1.0) == (
        4 * values["rotor.thrust_max"]
    )
    assert start_point(world, there)[2] > 0.3


# ---- who needs one


@pytest.mark.parametrize("uri", ["radio://0/80/2M/E7E7E7E7E7", "radio://1/2/250K/E7E7E7E701", "usb://0", "serial://x"])
def test_a_drone_without_a_site_is_refused_with_the_command_that_makes_one(
    uri: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for words in (["learn", FLIGHT], ["fly", FLIGHT, "--rrev", "4", "--moment", "8"], ["doctor", FLIGHT, "--send"]):
        assert cli.run([*words, "--uri", uri]) == 2
        told = capsys.readouterr().err
        assert told.count("\n") == 1
        assert "ivl site new lab.yaml" in told
    assert cli.run(["learn", FLIGHT, "--rehearse"]) == 2
    assert "ivl site new lab.yaml" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [], "a refused run leaves nothing"


def test_a_drone_is_not_flown_in_a_room_that_is_guessed_or_simulated(write: Callable[..., str]) -> None:
    radio = "radio://0/80/2M/E7E7E7E7E7"
    guessed = experiment.load(FLIGHT, site=write())
    with pytest.raises(ConfigError, match=r"not fit to fly: measured: not measured yet: surface\.height_m"):
        require.for_flight(guessed, radio)
    assert require.for_flight(guessed, "udp://127.0.0.1:1", rehearse=True) is not None
    assert require.for_flight(guessed, "udp://127.0.0.1:1") is not None
    simulated = experiment.load(FLIGHT, site=write(measured, put("mocap", {"system": "mock", "body": "x"})))
    with pytest.raises(ConfigError, match="tracking: mock, body x"):
        require.for_flight(simulated, radio)
    assert require.for_flight(experiment.load(FLIGHT, site=write(measured)), radio) is not None
    assert require.for_flight(experiment.load(FLIGHT), "udp://127.0.0.1:1") is None
    with pytest.raises(ConfigError, match="leads to no software vehicle"):
        require.for_flight(guessed, radio, rehearse=True)  # or a flag would fly a drone in a room that is guessed


def test_a_room_that_does_not_fit_is_refused_in_a_rehearsal_too(write: Callable[..., str]) -> None:
    there = experiment.load(FLIGHT, site=write(put("fence.z_m", [-0.2, 2.0])))
    with pytest.raises(ConfigError, match="ceiling inside fence"):
        require.for_flight(there, "rehearsal://", rehearse=True)


def test_the_link_of_a_site_has_a_name(write: Callable[..., str]) -> None:
    there = experiment.load(FLIGHT, site=write(put("link", "radio://0/42/1M/E7E7E7E701")))
    assert require.link_of(there, "site") == "radio://0/42/1M/E7E7E7E701"
    assert require.link_of(there, "usb://0") == "usb://0"
    assert require.link_of(there, None) is None
    with pytest.raises(ConfigError, match="the experiment has no site"):
        require.link_of(experiment.load(FLIGHT), "site")


def test_an_experiment_names_its_site_beside_itself(write: Callable[..., str], tmp_path: Path) -> None:
    write(put("surface.height_m", 2.15))
    data = yamlfile.read(Path(experiment.__file__).parent / FLIGHT)
    (tmp_path / "mine.yaml").write_text(yamlfile.dump({**data, "site": "lab.yaml"}))
    there = experiment.load(str(tmp_path / "mine.yaml"))
    assert there.make_world().params.values["world.ceiling_height"] == 2.15
    assert experiment.load(FLIGHT, [f"site={tmp_path}/lab.yaml"]) == experiment.load(
        FLIGHT, site=f"{tmp_path}/lab.yaml"
    )
    (tmp_path / "mine.yaml").write_text(yamlfile.dump({**data, "site": "lab"}))
    with pytest.raises(ConfigError, match="site: value 'lab': expected the path of a site file"):
        experiment.load(str(tmp_path / "mine.yaml"))
    with pytest.raises(ConfigError, match=r"no such file; make one with: ivl site new"):
        experiment.load(FLIGHT, site=str(tmp_path / "other.yaml"))


def test_a_run_can_be_simulated_in_the_room(write: Callable[..., str], tmp_path: Path) -> None:
    settings = ["learner.name=ephe_robust", "n_rollouts=4", "budget=4", "check.n_fresh=5", "check.effort=0.02"]
    there = experiment.load(FLIGHT, settings, site=write(put("surface.height_m", 2.2)))
    result = run.run(there, tmp_path / "run")
    assert result.world.params.values["world.ceiling_height"] == 2.2
    again, _ = run.read_config(tmp_path / "run")
    assert again.site is not None
    assert Path(again.site).parent == tmp_path / "run" / "files"
    assert run.run(again, tmp_path / "run", resume=True).summary["mu"] == result.summary["mu"]
