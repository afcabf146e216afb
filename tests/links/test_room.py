"""The drone's way to fly, rehearsed with a software vehicle: floor, operator, recorder, and the simulator's truth."""

import math
import struct
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ivl import experiment, forms, native, run
from ivl.belief import recording
from ivl.errors import ConfigError, LinkError, RolloutError, StoreError
from ivl.experiment import Experiment
from ivl.links import preflight, sil
from ivl.links.crazyflie import CrazyflieSource
from ivl.links.landing_flight import Rollout, make_safe
from ivl.links.operators import OperatorStopped, Seen, Upcoming
from ivl.links.options import Options
from ivl.links.packets import Phase, Request
from ivl.links.sites import room
from ivl.links.sites.room import Room
from ivl.links.tables import Session
from ivl.links.tracking import Tracking
from ivl.links.trouble import Cause, Trouble, Vetoed
from ivl.links.truth import Resting
from ivl.links.vehicle import Command, Supervisor, Vehicle
from ivl.mocap import config as mocap_config
from ivl.mocap.frame import FlightFrame
from ivl.silproc import SilProcess
from ivl.source import Plan
from ivl.startpoint import start_point

GOOD = Rollout((4.8, 8.0))


class Script:
    """An operator who answers as told; what was asked is in `asked`."""

    def __init__(self, answers: list[Callable[[Seen], Seen]] | None = None, n_flights: int = 10) -> None:
        self.answers = answers or []
        self.n_flights = n_flights
        self.asked: list[str] = []
        self.upcoming: list[Upcoming] = []
        self.on_help: Callable[[Cause], object] = lambda _: None
        self.resting: list[Resting] = []
        self.on_battery: Callable[[], object] = lambda: None

    def place(self, upcoming: Upcoming) -> None:
        assert upcoming.start_W_m[2] > 0.3
        self.upcoming.append(upcoming)
        if self.n_flights == 0:
            raise OperatorStopped("enough")
        self.n_flights -= 1
        self.asked.append("place")

    def change_battery(self, battery_V: float, needed_V: float) -> None:
        assert battery_V < needed_V
        self.asked.append(f"battery {battery_V:.1f}")
        self.on_battery()

    def help(self, cause: Cause) -> None:
        self.asked.append(f"help {cause}")
        self.on_help(cause)

    def confirm(self, suggested: Seen, resting: Resting, note: str) -> Seen:
        self.asked.append(f"confirm {suggested.n_legs} {note}".strip())
        self.resting.append(resting)
        return self.answers.pop(0)(suggested) if self.answers else suggested


@pytest.fixture(autouse=True)
def _slow_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy machine answers pings late; that is no fault of the room."""
    monkeypatch.setattr(preflight, "P95_S_MAX", 10.0)


@pytest.fixture
def script() -> Script:
    return Script()


@pytest.fixture
def source(server: SilProcess, in_room: Experiment, script: Script, tmp_path: Path) -> Iterator[CrazyflieSource]:
    with CrazyflieSource(server.uri, in_room, Options(tmp_path, script, rehearse=True, say=print)) as opened:
        yield opened


def plan_of(*rollouts: Rollout) -> Plan:
    theta = np.array([r.theta for r in rollouts])
    return Plan(theta, np.zeros(len(theta), dtype=np.uint64), np.arange(len(theta), dtype=np.uint64))


def truth(vehicle: Vehicle) -> np.ndarray:
    """The simulator's outcome of the landing that was just flown."""
    number = vehicle.session.memory(0x1E)
    assert number is not None
    dtype = native.library().outcome_dtype
    data = vehicle.session.read_memory(number, 0, 20 + dtype.itemsize, "outcome")
    assert struct.unpack("<5L", data[:20])[2] == dtype.itemsize
    return np.frombuffer(data[20:], dtype=dtype)


def vehicle_of(source: CrazyflieSource) -> Vehicle:
    assert source._vehicle is not None
    return source._vehicle


def test_landing_is_flown_from_the_floor_and_judged_as_the_simulator_does(
    source: CrazyflieSource, script: Script, tmp_path: Path
) -> None:
    landing = source.fly_one(GOOD)
    known = truth(vehicle_of(source))
    outcome = landing.outcome
    assert script.asked == ["place", "confirm 4"]
    assert outcome["n_legs"][0] == known["n_legs"][0] == 4
    assert outcome["triggered"][0] == known["triggered"][0] == 1
    assert outcome["d_trigger_m"][0] == known["d_trigger_m"][0]
    assert outcome["rrev_trigger"][0] == known["rrev_trigger"][0]
    flight_s = known["t_impact_s"][0] - known["t_trigger_s"][0]
    # the recorder has a row each 2 ms, and the accelerometer's first row after a contact is one more
    assert outcome["t_impact_s"][0] - outcome["t_trigger_s"][0] == pytest.approx(flight_s, abs=0.03)
    assert outcome["theta_impact_deg"][0] == pytest.approx(known["theta_impact_deg"][0], abs=30.0)
    assert outcome["vz_trigger_mps"][0] == pytest.approx(known["vz_trigger_mps"][0], abs=0.05)
    assert outcome["d_min_m"][0] == pytest.approx(known["d_min_m"][0], abs=0.02)
    assert landing.snapshot.policy_seq == landing.policy_seq == landing.recording.policy_seq
    (_,) = source.fly(plan_of(GOOD))
    (saved,) = (tmp_path / "recordings").iterdir()
    assert len(saved.read_text().splitlines()) == 1 + len(landing.recording.rows)
    assert vehicle_of(source).session.read(["supervisor.tmblChckEn"])["supervisor.tmblChckEn"] == 1


def test_fall_is_seen_as_no_landing(source: CrazyflieSource) -> None:
    outcome = source.fly_one(Rollout((2.0, 6.0))).outcome
    known = truth(vehicle_of(source))
    assert outcome["n_legs"][0] == known["n_legs"][0] == 0
    # the simulator ends a landing as soon as it can only be missed, the recorder sees the vehicle's whole rise
    assert known["d_min_m"][0] - 0.2 < outcome["d_min_m"][0] <= known["d_min_m"][0]
    assert source.world.end_reason(int(outcome["end_reason"][0])) == "missed"


def test_operator_corrects_the_outcome(source: CrazyflieSource, script: Script) -> None:
    script.answers = [lambda _: Seen(3, body_contact=True)]
    outcome = source.fly_one(GOOD).outcome
    assert (outcome["n_legs"][0], outcome["body_contact"][0]) == (3, 1)


def test_discarded_flight_is_flown_again_with_the_same_policy(source: CrazyflieSource, script: Script) -> None:
    script.answers = [lambda seen: Seen(seen.n_legs, False, discard=True)]
    (flown,) = source.fly(plan_of(GOOD))
    assert script.asked == ["place", "confirm 4", "place", "confirm 4"]
    assert source.n_discarded == 1
    assert flown.outcomes["n_legs"][0] == 4


def test_run_stops_and_keeps_what_was_flown_when_the_operator_stops(source: CrazyflieSource, script: Script) -> None:
    script.n_flights = 1
    flight = source.fly(plan_of(GOOD, GOOD))
    assert next(flight).outcomes["n_legs"][0] == 4
    with pytest.raises(OperatorStopped):
        next(flight)


def test_operator_is_asked_for_a_battery_until_it_is_good(
    source: CrazyflieSource, script: Script, server: SilProcess
) -> None:
    server.set("sil.vbat", 3.6)
    script.on_battery = lambda: server.set("sil.vbat", 3.5 if len(script.asked) < 3 else 4.0)
    source.fly_one(GOOD)
    assert script.asked[0] == "place"
    assert [line.split()[0] for line in script.asked] == ["place", "battery", "battery", "confirm"]


@pytest.mark.parametrize("link_is_lost", [False, True])
def test_battery_is_known_and_changed_before_a_policy_is_chosen(
    source: CrazyflieSource, script: Script, server: SilProcess, link_is_lost: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def change() -> None:
        if link_is_lost:  # as when the vehicle is without power meanwhile
            server.kill()
            server.start()
        server.set("sil.vbat", 4.0)

    source.world = source.world.changed(**{"battery.voltage": 4.0})
    server.set("sil.vbat", 3.6)
    vehicle_of(source).wait(lambda: vehicle_of(source).battery_V < 3.65, 2.0, "voltage", 0.05)
    script.on_battery = change
    known_V = source.battery_V()
    assert script.asked == ["battery 3.6"]
    assert np.isnan(known_V), "without a rehearsed day that battery drives no motors"
    monkeypatch.setattr(type(source._site), "_battery_V", Room._battery_V)
    assert source.battery_V() == recording.hover_V(source.world, source._experiment.flight, 4.0)


def test_a_battery_that_is_changed_between_two_attempts_gets_a_policy_of_its_own(
    source: CrazyflieSource, server: SilProcess, script: Script, monkeypatch: pytest.MonkeyPatch
) -> None:
    site = source._site
    assert site is not None
    monkeypatch.setattr(site, "before_approach", lambda _: server.set("sil.vbat", 2.6))
    monkeypatch.setattr(type(site), "_battery_V", Room._battery_V)
    monkeypatch.setattr(recording, "hover_V", lambda _world, _flight, rest_V: rest_V - 0.5)
    script.on_help = lambda _: server.set("sil.vbat", 4.1)
    told: list[tuple[list[float], float]] = []

    def rechoose(theta: np.ndarray, battery_V: float) -> np.ndarray:
        told.append((theta.tolist(), battery_V))
        return np.array([4.7, 7.9])

    (flown,) = source.fly(replace(plan_of(GOOD), rechoose=rechoose))
    assert told == [(list(GOOD.theta), pytest.approx(3.6))]
    assert flown.theta is not None
    assert flown.theta.tolist() == [[4.7, 7.9]]


def test_vehicle_that_aborts_for_its_surroundings_is_not_scored(
    source: CrazyflieSource, server: SilProcess, script: Script, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A battery that fails in the air: the operator is asked, nothing is scored, and the policy is flown again."""
    site = source._site
    assert site is not None
    monkeypatch.setattr(site, "before_approach", lambda _: server.set("sil.vbat", 2.6))
    script.on_help = lambda _: server.set("sil.vbat", 4.1)
    (flown,) = source.fly(plan_of(GOOD))
    assert script.asked == ["place", "help battery", "place", "confirm 4"]
    assert (source.troubles, source.refusals) == ({Cause.BATTERY: 1}, {})
    assert (flown.discarded, flown.outcomes["n_legs"][0]) == ("", 4)


def test_nothing_but_the_operator_ends_a_day(
    source: CrazyflieSource, script: Script, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Preflight refusals are no attempts: forty of them in a row, and the policy is flown all the same."""
    refused = iter(range(40))
    fit = Room._make_fit

    def make_fit(site: Room) -> None:
        if next(refused, None) is not None:
            raise Trouble(Cause.CRASHED, "the vehicle counts as crashed")
        fit(site)

    monkeypatch.setattr(Room, "_make_fit", make_fit)
    monkeypatch.setattr(source, "_recover", lambda: None)
    script.n_flights = 100
    (flown,) = source.fly(plan_of(GOOD))
    assert script.asked.count("help crashed") == 40
    assert (source.troubles, source.refusals) == ({}, {Cause.CRASHED: 40})
    assert flown.outcomes["n_legs"][0] == 4

    def refuse(_: Room) -> None:
        raise RolloutError("the vehicle refuses, and says no more")

    monkeypatch.setattr(Room, "_make_fit", refuse)
    script.n_flights, script.asked = 3, []
    with pytest.raises(OperatorStopped):
        next(source.fly(plan_of(GOOD)))
    assert script.asked == ["place", "help unfit"] * 3, "what has no question of its own would come again for ever"
    assert source.refusals[Cause.UNFIT] == 3


def test_a_flight_is_announced_with_its_number_and_what_is_expected_and_can_be_vetoed(
    source: CrazyflieSource, script: Script, monkeypatch: pytest.MonkeyPatch
) -> None:
    def veto(upcoming: Upcoming) -> None:
        script.upcoming.append(upcoming)
        raise Vetoed("vetoed by the operator")

    monkeypatch.setattr(script, "place", veto)
    flown = list(source.fly(plan_of(GOOD, Rollout((0.5, 1.0)))))
    assert [each.discarded for each in flown] == ["vetoed by the operator"] * 2
    assert (source.troubles, source.refusals) == ({}, {})
    assert [(each.number, each.n_all, each.theta) for each in script.upcoming] == [
        (1, 12, (4.8, 8.0)),
        (2, 12, (0.5, 1.0)),
    ]
    good, bad = (each.forecast for each in script.upcoming)
    assert good.n_landed > 0.9 * good.n
    assert bad.n_landed < 0.5 * bad.n
    assert str(good).startswith(f"simulated: {good.n_landed} of 64 land")


def test_a_vehicle_that_is_not_at_home_is_not_armed(
    server: SilProcess, in_room: Experiment, script: Script, monkeypatch: pytest.MonkeyPatch
) -> None:
    with CrazyflieSource(server.uri, in_room, Options(operator=script, rehearse=True)) as source:
        site = source._site
        assert isinstance(site, Room)
        armed: list[bool] = []
        monkeypatch.setattr(vehicle_of(source), "arm", armed.append)
        monkeypatch.setattr(site, "_room", site._room.model_copy(update={"home_m": (0.5, 0.0)}))
        monkeypatch.setattr(sil, "put_on_floor", lambda *_: None)
        with pytest.raises(Trouble, match=r"allowed within 0\.3 m of home \(0\.50, 0\.00, 0\)") as error:
            site.to_start(GOOD)
        assert error.value.cause is Cause.NOT_HOME
        assert armed == []
        monkeypatch.undo()


def test_an_operator_who_was_away_gets_a_vehicle_that_is_checked_again(
    source: CrazyflieSource, server: SilProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(room, "AWAY_S", -1.0)
    server.set("sil.vbat", 3.5)
    with pytest.raises(Trouble, match=r"not fit to fly: battery: 3\.5") as error:
        source._site.to_start(GOOD)  # type: ignore[union-attr]
    assert error.value.cause is Cause.BATTERY


def test_locked_vehicle_is_refused_with_what_to_do(source: CrazyflieSource) -> None:
    vehicle = vehicle_of(source)
    vehicle.session.send(9, 1, b"\x03")
    vehicle.pause(5.0)  # it has just landed, and looks for an emergency stop once it is ready again
    assert Supervisor.LOCKED in vehicle.supervisor()
    with pytest.raises(RolloutError, match="locked: switch it off and on again"):
        source._site._make_fit()  # type: ignore[union-attr]


@pytest.mark.parametrize("phase", [Phase.READY, Phase.APPROACH, Phase.FLIP])
def test_vehicle_is_brought_down_and_disarmed_from_any_phase(source: CrazyflieSource, phase: Phase) -> None:
    vehicle, site = vehicle_of(source), source._site
    assert site is not None
    start_W_m = site.to_start(GOOD)
    vehicle.put_policy(forms.by_name("constant"), [4.8, 8.0])
    vehicle.ask_for(Command(Request.HOVER, start_W_m), (Phase.READY,), 5.0)
    if phase != Phase.READY:
        vehicle.ask_for(Command(Request.APPROACH, start_W_m, 2.5, 1.57), (phase,), 5.0)
    done = make_safe(vehicle)
    assert done == ("flip completed, disarmed" if phase == Phase.FLIP else "landed, disarmed")
    assert vehicle.phase == Phase.IDLE
    vehicle.pause(4.0)
    assert not vehicle.is_flying()
    if phase != Phase.FLIP:
        assert vehicle.position_W_m[2] < 0.1


def test_hovering_vehicle_is_landed(source: CrazyflieSource) -> None:
    vehicle, site = vehicle_of(source), source._site
    assert site is not None
    site.to_start(GOOD)
    assert make_safe(vehicle) == "landed, disarmed"
    assert vehicle.position_W_m[2] < 0.1


def test_hovering_vehicle_is_landed_at_the_emergency_place_or_where_it_is(
    source: CrazyflieSource, monkeypatch: pytest.MonkeyPatch
) -> None:
    vehicle, site = vehicle_of(source), source._site
    assert site is not None
    site.to_start(GOOD)
    assert make_safe(vehicle, (-0.5, 0.25)) == "landed, disarmed"
    assert vehicle.position_W_m[:2] == pytest.approx((-0.5, 0.25), abs=0.1)
    site.to_start(GOOD)

    def refuse(*_: object) -> None:
        raise RolloutError("refused")

    monkeypatch.setattr(vehicle, "go_to", refuse)
    assert make_safe(vehicle, (-0.5, 0.25)) == "could not fly to the emergency place, landed, disarmed"
    monkeypatch.undo()
    assert vehicle.position_W_m[:2] == pytest.approx((0.0, 0.0), abs=0.1)


def test_vehicle_is_disarmed_though_its_planner_does_not_answer(
    source: CrazyflieSource, monkeypatch: pytest.MonkeyPatch
) -> None:
    vehicle, asked = vehicle_of(source), []

    def fall_silent() -> None:
        raise LinkError("no answer")

    def refuse(do: bool) -> bool:
        asked.append(do)
        return True

    monkeypatch.setattr(vehicle, "stop_planner", fall_silent)
    monkeypatch.setattr(vehicle, "arm", refuse)
    with pytest.raises(LinkError, match="no answer"):
        make_safe(vehicle)
    assert asked == [False]
    monkeypatch.setattr(vehicle, "stop_planner", lambda: None)
    assert make_safe(vehicle) == "STILL ARMED"
    monkeypatch.undo()


def test_ctrl_c_in_the_air_lands_the_vehicle(server: SilProcess, in_room: Experiment, script: Script) -> None:
    def press(rollout: Rollout) -> None:
        del rollout
        raise KeyboardInterrupt

    said: list[str] = []
    options = Options(operator=script, rehearse=True, say=said.append)
    source = CrazyflieSource(server.uri, in_room, options)
    assert source._site is not None
    source._site.before_approach = press  # type: ignore[method-assign]
    with pytest.raises(KeyboardInterrupt):
        next(source.fly(plan_of(GOOD)))
    source.close()
    assert said == ["vehicle: landed, disarmed"]
    assert server.get("ivl.phase") == Phase.IDLE
    assert server.get("stateEstimate.z") < 0.1


def test_lost_camera_before_the_trigger_aborts_and_is_not_scored(
    server: SilProcess, in_room: Experiment, script: Script, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """In real time, since cameras have a clock of their own: on a busy machine that is slow, and not a loss."""
    monkeypatch.setattr(sil, "put_on_floor", lambda *_: None)  # it has just been started there
    monkeypatch.setattr(preflight, "P95_S_MAX", 10.0)
    limits = {"lost_s": 0.7, "frozen_s": 0.7, "settle_s": 0.75, "rate_hz_min": 1.0, "jitter_ms_max": 1000.0}
    cameras = mocap_config.load("simulator").model_copy(update=limits)
    # the vehicle may fly on its last pose, and without its host, for longer than that: it is the host who notices
    (tmp_path / "patient.yaml").write_text(in_room.to_yaml())
    settings = ["firmware.stale_s_max=1.0", "firmware.p_sigma_max=10.0", "firmware.host_s_max=10.0"]
    patient = experiment.load(str(tmp_path / "patient.yaml"), settings)
    with CrazyflieSource(server.uri, patient, Options(operator=script, rehearse=True, mocap=cameras)) as source:
        tracking, vehicle = source._tracking, vehicle_of(source)
        assert tracking is not None
        assert tracking.room is not None
        room = tracking.room

        def occlude() -> None:
            while vehicle.phase != Phase.READY:
                time.sleep(0.01)
            room.occluded = True

        thread = threading.Thread(target=occlude)
        thread.start()
        with pytest.raises(RolloutError, match=r"aborted: motion capture: cf21 is not seen"):
            source.fly_one(GOOD)
        thread.join()
        assert vehicle.phase == Phase.ABORTED
        server.kill()


def test_simulated_cameras_see_the_flight_frame_whatever_the_axes_of_the_site_are(server: SilProcess) -> None:
    axes = FlightFrame((3.0, -2.0), 1.0)
    with Session(server.uri) as session:
        limits = {"rate_hz_min": 1.0, "jitter_ms_max": 1000.0, "settle_s": 0.75}
        tracking = Tracking(session, mocap_config.load("simulator").model_copy(update=limits), axes)
        seen = tracking.resting()
        tracking.close()
    assert seen is not None
    assert math.dist(seen.p_W_m[:2], (server.get("simTruth.x"), server.get("simTruth.y"))) < 0.05


def test_start_point_leaves_room_for_speed_and_hold(in_room: Experiment) -> None:
    world = in_room.make_world()
    x, y, z = start_point(world, in_room)
    accel, hold_s = world.params.values["firmware.approach_accel"], world.params.values["start.hold_time"]
    plane = world.params.values["world.ceiling_height"] + world.params.values["world.sensed_gap_offset"]
    assert (x, y) == pytest.approx((0.0, 0.0))
    assert z == pytest.approx(plane - 2.5**2 / (2 * accel) - 2.5 * hold_s, abs=1e-6)
    with pytest.raises(ConfigError, match=r"speed_mps: value 4 m/s .* above the floor"):
        start_point(world, in_room.model_copy(update={"speed_mps": 4.0}))


def test_an_approach_that_never_triggered_is_scored_from_what_was_seen(source: CrazyflieSource) -> None:
    """Its recorder is empty, and it ends on the floor: the least distance is that of the approach."""
    chosen = source._experiment
    slow = chosen.model_copy(update={"speed_mps": 0.8})
    source._experiment = slow
    outcome = source.fly_one(Rollout((20.0, 8.0))).outcome
    known = truth(vehicle_of(source))
    assert outcome["triggered"][0] == 0
    assert outcome["d_min_m"][0] == pytest.approx(known["d_min_m"][0], abs=0.1)
    assert outcome["d_min_m"][0] < 0.5


@pytest.mark.parametrize(
    ("judge", "is_tracked", "n_legs", "asked"),
    [
        ("tracking", True, 4, False),
        ("tracking", True, 0, False),
        ("tracking", True, 2, True),
        ("tracking", False, 4, True),
        ("operator", True, 4, True),
    ],
)
def test_tracking_judges_where_it_is_sure(
    source: CrazyflieSource, script: Script, judge: str, is_tracked: bool, n_legs: int, asked: bool
) -> None:
    site = source._site
    assert isinstance(site, Room)
    site._room = site._room.model_copy(update={"judge": judge})
    resting = Resting((0.0, 0.0, 2.0), (0.0, 0.0, -1.0))
    assert site._judge(Seen(n_legs, False), resting, "", is_tracked).n_legs == n_legs
    assert bool(script.asked) is asked


def test_a_run_goes_on_over_another_link_with_another_vehicle_and_says_so(
    in_room: Experiment, script: Script, tmp_path: Path
) -> None:
    """Two software vehicles of the same file, each on a port of its own; no simulator goes on where a vehicle flew."""
    chosen = in_room.model_copy(update={"n_rollouts": 2, "budget": 2})
    world, notes = chosen.make_world(), []
    script.n_flights = 1

    def fly(uri: str, resume: bool, **options: bool) -> None:
        flight = Options(operator=script, say=print, **options)
        run.run(chosen, tmp_path / "run", resume=resume, hooks=run.Hooks(on_note=notes.append), uri=uri, flight=flight)

    with SilProcess(world, seed=1) as first, pytest.raises(OperatorStopped):
        fly(first.uri, resume=False, rehearse=True)
    script.n_flights = 1
    with SilProcess(world, seed=2) as second:
        fly(second.uri, resume=True, rehearse=True)
        with pytest.raises(StoreError, match="it is flown in a room, and now would be not flown in a room"):
            fly(second.uri, resume=True, other_world=True)
        with pytest.raises(StoreError, match="cannot be resumed without its vehicle: add --rehearse"):
            run.run(chosen, tmp_path / "run", resume=True)
    assert f"the link was {first.uri}, and is {second.uri}" in notes
    assert any(note.startswith("the vehicle was 00515649") and note.endswith("2") for note in notes)
    assert script.asked.count("place") == 2
