"""Where is flown: which site a vehicle gets, and a new one that is a class and a row."""

import json
import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from ivl import experiment
from ivl.check import Check
from ivl.errors import ConfigError, RolloutError
from ivl.experiment import Experiment
from ivl.links import crazyflie, preflight, sil, sites
from ivl.links.clock import FINE, Clock, LockStep
from ivl.links.crazyflie import CrazyflieSource
from ivl.links.forecast import Forecasts
from ivl.links.landing_flight import FlyingEnds, Landing, Outcome, Rollout, safe_or_why
from ivl.links.options import Options
from ivl.links.packets import Phase, Recording
from ivl.links.recovery import Attempts, Recovery
from ivl.links.sites.base import Visit, give_back_time
from ivl.links.sites.rehearsal import Rehearsal
from ivl.links.sites.room import Room
from ivl.links.sites.simulator import Simulator
from ivl.links.tables import Session
from ivl.links.truth import outcome_of_flight, suggest_legs
from ivl.links.vehicle import Vehicle
from ivl.mocap import config as mocap_config
from ivl.silproc import SilProcess
from ivl.site.file import SiteFile
from ivl.source import Plan
from ivl.startpoint import Point, start_point

GOOD = (4.8, 8.0)


class Hall:
    """A site of these tests: the software vehicle comes by air, nobody is asked, and its own recorder judges."""

    contact_is_seen, is_flown = False, True

    def __init__(self, vehicle: Vehicle, visit: Visit) -> None:
        self._vehicle, self._visit = vehicle, visit
        self._start_W_m = start_point(visit.world, visit.experiment)
        self.calls: list[str] = []

    @staticmethod
    def suits(session: Session, options: Options) -> bool:
        return sil.is_sil(session) and not options.rehearse

    @staticmethod
    def recovery(session: Session, options: Options) -> Recovery:
        return Attempts(session.uri, options.say)

    @staticmethod
    def make_clock(session: Session, visit: Visit) -> Clock:
        del visit
        return LockStep(session, FINE)

    def make_ready(self, again: bool) -> None:
        self.calls.append("again" if again else "ready")
        sil.reset(self._vehicle)

    def checks(self) -> Iterator[Check]:
        yield preflight.tables(self._vehicle)

    def prove(self, fly: Callable[[Rollout], Outcome]) -> None:
        del fly
        self.calls.append("prove")

    def leave(self) -> None:
        self.calls.append("leave")
        safe_or_why(self._vehicle)
        give_back_time(self._vehicle.clock, self._visit.options.say)

    def to_start(self, rollout: Rollout) -> Point:
        del rollout
        self._vehicle.has_begun = True
        self.calls.append("start")
        sil.reset(self._vehicle)
        self._vehicle.go_to(self._start_W_m, 3.0)
        self._vehicle.pause(5.0)
        return self._start_W_m

    def before_approach(self, rollout: Rollout) -> None:
        del rollout
        self.calls.append("approach")

    def outcome(self, policy_seq: int) -> tuple[Outcome, Recording | None]:
        vehicle, world = self._vehicle, self._visit.world
        vehicle.wait(lambda: vehicle.phase in (Phase.DONE, Phase.ABORTED), 30.0, "end of the landing")
        recording = vehicle.recording(policy_seq)
        resting = sites.room.resting_by_estimate(vehicle, recording)
        legs = suggest_legs(resting, world)
        return outcome_of_flight(recording, vehicle.snapshot(), legs, False, resting, world), recording

    def end_flight(self) -> None:
        pass

    def rotor_V(self, landing: Landing) -> float:
        del landing
        return math.nan

    def told(self, landing: Landing) -> str:
        return f"hall: {int(landing.outcome['n_legs'][0])} legs"

    def after_refusal(self) -> None:
        self.calls.append("refusal")

    def after_fault(self) -> None:
        self.calls.append("fault")
        give_back_time(self._vehicle.clock, self._visit.options.say)


@pytest.fixture
def hall(monkeypatch: pytest.MonkeyPatch) -> type[Hall]:
    monkeypatch.setattr(sites, "SITES", (Hall, *sites.SITES))
    return Hall


def hall_of(source: CrazyflieSource) -> Hall:
    assert isinstance(source._site, Hall)
    return source._site


def plan_of(*theta: tuple[float, float]) -> Plan:
    n = len(theta)
    return Plan(np.array(theta), np.full(n, 7, dtype=np.uint64), np.arange(n, dtype=np.uint64))


@pytest.mark.usefixtures("hall")
def test_new_site_is_a_class_and_a_row(server: SilProcess, vertical: Experiment, tmp_path: Path) -> None:
    said: list[str] = []
    with CrazyflieSource(server.uri, vertical, Options(tmp_path, say=said.append)) as source:
        site = hall_of(source)
        (flown,) = source.fly(plan_of(GOOD))
    assert site.calls == ["ready", "prove", "start", "approach", "leave"]
    assert (flown.discarded, flown.outcomes["n_legs"][0], flown.outcomes["triggered"][0]) == ("", 4, 1)
    assert said == ["hall: 4 legs"]
    assert server.get("sil.lockstep") == 0, "time must pass for whoever comes next"
    (line,) = (tmp_path / "flights.jsonl").read_text().splitlines()
    assert (json.loads(line)["what"], json.loads(line)["n_legs"]) == ("flown", 4)
    assert [path.name for path in (tmp_path / "recordings").iterdir()] == [f"rollout-001-{7:016x}.csv"]


def open_the_door(_: Rollout) -> None:
    raise RolloutError("a door opens")


@pytest.mark.usefixtures("hall")
def test_site_hears_of_refusals_and_faults(server: SilProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = ["firmware.flip_moment_max=0.01", "policy.moment_y_Nmm.bounds=[0.0, 10.0]"]
    weak = experiment.load("experiments/paper_vertical.yaml", settings)
    with CrazyflieSource(server.uri, weak) as source:
        site = hall_of(source)
        refused, _ = source.fly(plan_of((4.8, 12.0), GOOD))
        assert refused.discarded.startswith("vehicle: policy constant: RREV_c 4.8 1/s, M_yd 12 N mm")
        assert site.calls == ["ready", "prove", "start", "refusal", "start", "approach"]
        del site.calls[:]
        monkeypatch.setattr(site, "before_approach", open_the_door)
        (again,) = source.fly(plan_of(GOOD))
        assert site.calls == ["start", "fault"]
        assert hall_of(source) is not site, "each connection has a site of its own"
        assert hall_of(source).calls == ["again", "start", "approach"]
    assert (source.n_discarded, again.outcomes["n_legs"][0]) == (1, 4)


@pytest.mark.usefixtures("hall")
def test_site_can_end_the_run(server: SilProcess, vertical: Experiment, monkeypatch: pytest.MonkeyPatch) -> None:
    def close(_: Rollout) -> Point:
        raise FlyingEnds("the hall closes")

    with CrazyflieSource(server.uri, vertical) as source:
        monkeypatch.setattr(hall_of(source), "to_start", close)
        with pytest.raises(FlyingEnds, match="the hall closes"):
            next(source.fly(plan_of(GOOD)))
        assert source.n_discarded == 0


class Connected:
    """What a session tells of a vehicle's kind."""

    def __init__(self, software: bool) -> None:
        self._names = {"sil.reset"} if software else set()

    def has_param(self, name: str) -> bool:
        return name in self._names


@pytest.mark.parametrize(
    ("software", "rehearse", "site"),
    [(True, False, Simulator), (True, True, Rehearsal), (False, False, Room), (False, True, Room)],
)
def test_a_vehicle_gets_the_site_that_suits_it(software: bool, rehearse: bool, site: type) -> None:
    session = Connected(software)
    assert sites.site_for(session, Options(rehearse=rehearse)) is site  # type: ignore[arg-type]


def test_a_site_is_one_file_and_one_row() -> None:
    files = {path.stem for path in Path(sites.__file__).parent.glob("*.py")} - {"__init__", "base"}
    assert {site.__module__.rpartition(".")[2] for site in sites.SITES} == files


def test_the_source_does_not_know_what_kinds_of_sites_there_are() -> None:
    text = Path(crazyflie.__file__).read_text(encoding="utf-8")
    assert re.findall(r"is_sil|rehears|simulator|[Rr]oom|operators|isinstance|links import .*\bsil\b", text) == []


class Elsewhere:
    """What a room is told of a vehicle that is no software vehicle, whatever its link."""

    def __init__(self) -> None:
        self.session = Connected(software=False)
        self.session.uri = "tcp://10.0.0.1:5000"  # type: ignore[attr-defined]


def test_a_drone_behind_any_link_needs_a_room_that_is_measured_and_tracked(
    vertical: Experiment, in_room: Experiment
) -> None:
    site = Options().site_of(in_room, "tcp://10.0.0.1:5000")
    assert site is not None
    camera = mocap_config.load("vicon")

    def enter(chosen: Experiment, place: SiteFile | None, **options: bool) -> Room:
        world = chosen.make_world()
        visit = Visit(chosen, world, Options(**options), place, None, Forecasts(world, chosen), print)
        return Room(Elsewhere(), visit)  # type: ignore[arg-type]

    assert enter(in_room, site)
    for place, options, told in (
        (None, {}, "flies only in a room that is described"),
        (site, {"rehearse": True}, "leads to no software vehicle"),
        (site.model_copy(update={"not_measured": ["home_m"]}), {}, "not measured yet: home_m"),
        (site.model_copy(update={"mocap": camera}), {}, "track it as its site says"),
    ):
        with pytest.raises(ConfigError, match=told):
            enter(in_room if place else vertical, place, **options)


def test_an_installed_package_gives_a_site_by_an_entry_point(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = (
        "from ivl.links.sites.room import Room\n\n\n"
        "class Cage(Room):\n"
        "    suits = staticmethod(lambda session, options: not session.has_param('sil.reset'))\n\n\n"
        "class Shed:\n"
        "    suits = staticmethod(lambda session, options: True)\n"
    )
    (tmp_path / "ivl_site_of_a_lab.py").write_text(source)
    info = tmp_path / "lab-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: lab\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[ivl.sites]\ncage = ivl_site_of_a_lab:Cage\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert sites.site_for(Connected(software=False), Options()).__name__ == "Cage"  # type: ignore[arg-type]
    assert sites.site_for(Connected(software=True), Options()) is Simulator  # type: ignore[arg-type]
    (info / "entry_points.txt").write_text("[ivl.sites]\nshed = ivl_site_of_a_lab:Shed\n")
    with pytest.raises(ConfigError, match="site 'shed': Shed lacks after_fault"):
        sites.site_for(Connected(software=False), Options())  # type: ignore[arg-type]
