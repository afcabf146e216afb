"""Pictures of a policy for every approach: what they show is what the core decides and what was flown."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import policies
import pytest
from matplotlib.figure import Figure
from policies import TASK

import ivl
from ivl import cli, forms, native
from ivl.analysis.intervals import wilson
from ivl.outcome import Outcomes, four_leg, verdict
from ivl.plots import policy as pictures
from ivl.plots import policy_flow_space, policy_go, policy_rates, policy_surface, strobe, style
from ivl.policy import assess as judging
from ivl.policy import cells, file, go
from ivl.policy.flying import Place, fly, fly_own
from ivl.policy.general import MapSettings
from ivl.policy.region import BOX, PLANE, Approaches
from ivl.policy.shape import General
from ivl.policy.survey import Path as FlownPath
from ivl.policy.survey import Survey, survey
from ivl.task import settings_of
from ivl.world import Trace

Capture = pytest.CaptureFixture[str]
GENERAL = General("polynomial2")
N = 60
GRID = MapSettings(n_speeds=3, n_angles=2, n_thresholds=12, moments_norm=[0.9])
SLOW = {"speed_mps": 0.8, "angle_deg": 85.0}
"""An approach that the policy refuses."""


@pytest.fixture(scope="module")
def found() -> Survey:
    return survey(policies.by_hand(), N, seed=5, grid=GRID)


def figure_of(draw: Any, *arguments: Any) -> Figure:
    """The figure that is drawn, in place of its files."""
    figures: list[Figure] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(style, "save", lambda figure, paths, _dpi=0: figures.append(figure) or list(paths))
        draw(*arguments)
    return figures[0]


def decide(vx: np.ndarray, vz: np.ndarray, rrev: np.ndarray) -> np.ndarray:
    """What the core itself decides, without the package's own way to ask it."""
    d_m = vz / rrev
    seen = np.stack([d_m, rrev, -vx / d_m], axis=-1).reshape(-1, 3)
    form = GENERAL.form
    return native.library().decide(form.number, form.to_si(policies.good_theta()), seen).reshape(*vx.shape, 4)


# ---- the surface


def test_the_surface_is_where_the_core_begins_to_flip() -> None:
    figure = figure_of(policy_surface.draw, GENERAL, np.array(policies.good_theta()), [])
    left, right = figure.axes[:2]
    threshold, p = (np.asarray(axis.collections[0].get_array()) for axis in (left, right))
    vx, vz = np.meshgrid(policy_surface._VX_MPS, policy_surface._VZ_MPS)
    assert threshold.shape == p.shape == vx.shape == (len(policy_surface._VZ_MPS), len(policy_surface._VX_MPS))
    assert np.ptp(threshold) > 1.0
    assert not decide(vx, vz, 0.9999 * threshold)[..., 0].any()
    assert decide(vx, vz, 1.0001 * threshold)[..., 0].all()
    assert decide(vx, vz, threshold)[..., 3] == pytest.approx(p, abs=1e-5)
    assert right.collections[0].get_clim() == (0.0, 1.0)
    assert "v_x" in left.get_xlabel()
    assert "v_z" in left.get_ylabel()


def test_box_and_plane_are_drawn_where_they_are_commanded() -> None:
    figure = figure_of(policy_surface.draw, GENERAL, np.array(policies.good_theta()), [])
    for axis in figure.axes[:2]:
        for line, region in zip(axis.lines, (BOX, PLANE), strict=True):
            vx, vz = line.get_xydata().T
            speed, angle = np.hypot(vx, vz), np.rad2deg(np.arctan2(vz, vx))
            assert (speed.min(), speed.max()) == pytest.approx(region.speeds_mps)
            assert (angle.min(), angle.max()) == pytest.approx(region.angles_deg)
            on_an_arc = np.isclose(speed[:, None], region.speeds_mps).any(axis=1)
            assert on_an_arc.all()
            assert (vx[0], vz[0]) == (vx[-1], vz[-1])


# ---- rates


def test_approaches_lie_all_over_their_own_cell() -> None:
    some = cells.Cells.of(BOX, 4, 3)
    drawn, other = some.draw(50, seed=3), some.draw(50, seed=4)
    number = some.number_of(drawn.speed_mps, drawn.angle_deg)
    assert number.tolist() == np.repeat(np.arange(12), 50).tolist()
    assert len(set(drawn.stream.tolist())) == 600
    for of in (drawn.speed_mps, drawn.angle_deg):
        assert len(np.unique(of)) == 600
    inside = (drawn.speed_mps - 1.5) % 0.5
    assert inside.min() < 0.01 < 0.49 < inside.max()
    assert not np.isin(other.speed_mps, drawn.speed_mps).any()


def test_an_approach_belongs_to_the_cell_around_it() -> None:
    some = cells.Cells(np.array([1.0, 2.0, 4.0]), np.array([20.0, 50.0, 90.0]))
    speed, angle = np.array([1.0, 1.9, 2.0, 3.9, 4.0, 0.5]), np.array([20.0, 60.0, 49.0, 90.0, 51.0, 95.0])
    assert some.number_of(speed, angle).tolist() == [0, 1, 2, 3, 3, 1]


def made_up(scores: np.ndarray, n: int) -> Outcomes:
    """Flights (..., cells * n) of which the n of each cell score what is said of it: 1, 1/2 or 0."""
    numbers = np.repeat(scores, n, axis=-1)
    outcomes: Outcomes = np.zeros(numbers.shape, dtype=native.library().outcome_dtype)
    outcomes["n_legs"], outcomes["body_contact"] = 4 * (numbers > 0), numbers == 0.5
    return outcomes


def test_the_best_of_a_cell_wins_on_flights_that_did_not_propose_it(monkeypatch: pytest.MonkeyPatch) -> None:
    grid = MapSettings(n_speeds=2, n_angles=2, n_thresholds=4, tau_s=[0.1, 0.4], moments_norm=[0.5, 0.9])
    scores = np.zeros((2, 4, 4))
    for cell, (moment, threshold) in enumerate([(0, 0), (1, 2), (1, 3), (0, 2)]):
        scores[moment, threshold, cell] = 1.0
    scores[1, 2, 2] = 0.5
    finals = np.zeros((5, 4))
    finals[[0, 0, 1, 0], range(4)] = 1.0
    monkeypatch.setattr(cells, "fly", lambda *_: [made_up(scores, 2)])
    monkeypatch.setattr(cells, "fly_own", lambda *_: [made_up(finals, 16)])
    place = Place.of(TASK)
    best = cells.best_of_cells(grid, BOX, 0, [place])
    low, high = (place.world.derived()["pitch_moment_max_Nmm"] * part for part in (0.5, 0.9))
    assert best.of_all == pytest.approx((1 / 0.3, high))  # lands in two cells
    third = [1 / 0.3, high]  # second on the grid
    assert best.theta == pytest.approx(np.array([[10.0, low], [1 / 0.3, high], third, [1 / 0.3, low]]))
    assert best.n_flights == 2 * 4 * 8 + 5 * 64


def test_the_best_of_each_cell_beats_one_policy_for_all_on_fresh_approaches() -> None:
    places = [Place.of(TASK)]
    grid = MapSettings(n_speeds=5, n_angles=5, n_thresholds=20, tau_s=[0.12, 0.4], moments_norm=[0.9])
    effort = cells.Effort(n_coarse=2, n_finalists=5, n_choose=16)
    best = cells.best_of_cells(grid, BOX, 1, places, effort)
    approaches = judging.fresh(BOX, 200, seed=2)
    (own,) = fly_own(places, forms.PAPER, best.of(approaches), approaches)
    (one,) = fly(places, forms.PAPER, best.of_all, approaches)
    assert four_leg(own).mean() > four_leg(one).mean() > 0.8
    again = cells.best_of_cells(grid, BOX, 1, places, effort)
    assert np.array_equal(best.theta, again.theta)


def test_each_approach_is_flown_with_its_own_policy(found: Survey) -> None:
    places = [Place.of(TASK)]
    part = Approaches(*(getattr(found.approaches, n)[:6] for n in ("speed_mps", "angle_deg", "stream")), seed=3)
    theta = np.column_stack([np.linspace(4.0, 6.0, 6), np.linspace(8.0, 9.0, 6)])
    (together,) = fly_own(places, forms.PAPER, theta, part)
    (crossed,) = fly(places, forms.PAPER, theta, part)
    assert crossed.shape == (6, 6)
    assert all(together[i].tobytes() == crossed[i, i].tobytes() for i in range(6))
    assert len(set(together["t_impact_s"].tolist())) > 1


def test_the_rates_are_those_of_the_flights_that_assess_counts(found: Survey) -> None:
    figure = figure_of(policy_rates.draw, found, [])
    panels = figure.axes[:3]
    judged = judging.assess(policies.by_hand(), n_approaches=N, seed=5)
    speed, angle = np.linspace(*PLANE.speeds_mps, 4), np.linspace(*PLANE.angles_deg, 3)
    v, phi = found.approaches.speed_mps, found.approaches.angle_deg
    for axis, flown in zip(panels, (found.by_constant, found.by_policy, found.by_best), strict=True):
        shown = np.ma.filled(axis.collections[0].get_array().astype(float), np.nan)
        assert shown.shape == (3, 2)
        assert axis.collections[0].get_clim() == (0.0, 1.0)
        landed = four_leg(flown[0])
        for i in range(3):
            for j in range(2):
                inside = (v >= speed[i]) & (v < speed[i + 1]) & (phi >= angle[j]) & (phi < angle[j + 1])
                wanted = landed[inside].mean() if inside.any() else np.nan
                assert shown[i, j] == pytest.approx(wanted, nan_ok=True)
        assert f"{100 * landed.mean():.1f} % land" in axis.get_title()
    assert four_leg(found.by_policy[0]).mean() == judged.plane.landed.value
    assert judged.go is not None
    assert go.would_refuse(found.by_policy[0], found.p_min).mean() == judged.go.no_go.value
    crosses = panels[1].collections[1].get_offsets()
    assert len(crosses) == (found.refused() > 0.5).sum()
    assert found.refused()[0, 1] > 0.5  # slow and steep


def test_the_constant_policy_is_the_best_of_the_map_or_the_one_that_is_said(found: Survey) -> None:
    assert found.constant == found.best.of_all
    said = survey(policies.by_hand(), 8, seed=5, grid=GRID, constant=(4.8, 8.0))
    (direct,) = fly([Place.of(TASK)], forms.PAPER, [4.8, 8.0], said.approaches)
    assert said.by_constant[0].tobytes() == direct.tobytes()
    with pytest.raises(ivl.errors.ArgumentError, match="out of range"):
        survey(policies.by_hand(), 8, constant=(4.8, 800.0), grid=GRID)


def test_level_policies_of_the_map_are_the_paper_s(found: Survey) -> None:
    theta = np.array([found.constant])
    level = GENERAL.level(theta[:, 0], theta[:, 1])
    place = [Place.of(TASK)]
    (one,), (other,) = (
        fly(place, "polynomial2", level, found.approaches),
        fly(place, forms.PAPER, theta, found.approaches),
    )
    for name in ("n_legs", "t_trigger_s", "t_impact_s", "body_contact"):
        assert np.array_equal(one[name], other[name], equal_nan=one[name].dtype.kind == "f")


def test_flights_of_two_tasks_count_both() -> None:
    late = TASK.model_copy(update={"overrides": settings_of({"sense.latency": 0.05}, "test")})
    policy = file.make(GENERAL.form, policies.good_theta(), [TASK, late], None, None)
    both = survey(policy, 30, seed=5, grid=GRID)
    own, other = both.by_policy
    assert four_leg(other).mean() < four_leg(own).mean()
    assert both.rates([own, other]) == pytest.approx(0.5 * (both.rates([own]) + both.rates([other])), nan_ok=True)
    p, _ = both.decided()
    assert len(p) == sum(go.has_decided(outcomes).sum() for outcomes in both.by_policy)


# ---- the flow space


def test_the_surface_in_flow_space_is_the_core_s() -> None:
    of_y, rrev, d_m = np.moveaxis(policy_flow_space.surface(GENERAL, np.array(policies.good_theta())), -1, 0)
    vx, vz = -of_y * d_m, rrev * d_m
    assert (np.hypot(vx, vz).min(), np.hypot(vx, vz).max()) == pytest.approx(PLANE.speeds_mps)
    assert not decide(vx, vz, 0.9999 * rrev)[..., 0].any()
    assert decide(vx, vz, 1.0001 * rrev)[..., 0].all()


def test_a_path_ends_where_it_first_meets_the_surface(found: Survey) -> None:
    assert len(found.paths) == 40
    n_triggered = 0
    for path, outcome in zip(found.paths, found.by_policy[0], strict=False):
        assert path.triggered == bool(outcome["triggered"])
        assert path.landed == bool(outcome["n_legs"] >= 3)
        if path.triggered:
            n_triggered += 1
            vx, vz = -path.of_y_radps * path.d_ceil_m, path.rrev_per_s * path.d_ceil_m
            flips = decide(np.maximum(vx, 0.0), vz, path.rrev_per_s)[:, 0]
            assert flips[-1] == 1.0
            assert not flips[:-3].any()
            assert path.rrev_per_s[-1] == outcome["rrev_trigger"]
    assert n_triggered > 20


def test_every_path_is_drawn_in_all_views(found: Survey) -> None:
    figure = figure_of(policy_flow_space.draw, found, [])
    space, upper, lower = figure.axes
    assert len(space.lines) == 40
    n_surface = len(range(0, policy_flow_space._N_LINES, policy_flow_space._N_LINES // 4))
    for axis in (upper, lower):
        assert len(axis.lines) == 2 * 40 + n_surface
        assert len(axis.collections[0].get_offsets()) == len(found.best.landable()) > 0
    assert upper.get_ylabel().startswith("RREV")
    assert lower.get_xlabel().startswith("$d$")


def test_an_approach_without_a_cue_is_told_not_drawn(found: Survey) -> None:
    none = np.zeros(0)
    blind = replace(found, paths=[*found.paths[:3], FlownPath(none, none, none, triggered=False, landed=False)])
    n_seen = sum(len(path.d_ceil_m) > 0 for path in found.paths[:3])
    figure = figure_of(policy_flow_space.draw, blind, [])
    assert f"{n_seen} fresh approaches" in figure._suptitle.get_text()
    assert f"{4 - n_seen} more begin too near for a cue" in figure._suptitle.get_text()


# ---- go / no-go


def test_the_reliability_diagram_is_a_direct_count(found: Survey) -> None:
    figure = figure_of(policy_go.draw, found, [])
    top, bottom = figure.axes
    outcomes = found.by_policy[0]
    told = outcomes["p_land"] > 0
    p, landed = outcomes["p_land"][told], four_leg(outcomes)[told]
    points = next(line for line in top.lines if line.get_marker() == "o").get_xydata()
    segments = top.collections[0].get_segments()
    inside = [(p >= k / 10) & ((p < (k + 1) / 10) | (k == 9)) for k in range(10)]
    inside = [mask for mask in inside if mask.any()]
    assert len(points) == len(segments) == len(inside) > 2
    for (x, y), segment, mask in zip(points, segments, inside, strict=True):
        assert (x, y) == pytest.approx((p[mask].mean(), landed[mask].mean()))
        low, high = wilson(landed[mask].mean(), mask.sum())
        assert segment[:, 1] == pytest.approx([low, high])
    heights = np.array([bar.get_height() for bar in bottom.patches]).reshape(2, 10).sum(axis=1)
    assert heights.tolist() == [landed.sum(), (~landed).sum()]
    assert f"{told.sum()} decisions" in figure._suptitle.get_text()


def test_bins_without_decisions_are_empty() -> None:
    bins = go.binned(np.zeros(0), np.zeros(0, dtype=bool))
    assert bins.count.tolist() == [0] * 10
    assert np.isnan(bins.p).all()
    assert np.isnan(bins.landed).all()


# ---- a no-go as a strobe picture


@pytest.fixture(scope="module")
def no_go() -> tuple[ivl.World, Trace]:
    world = Place.of(TASK).world
    trace = world.trace(*SLOW.values(), *policies.good_theta(), form="polynomial2", start="flown", period_s=0.001)
    assert trace.outcome.no_go == 1
    return world, trace


def test_a_no_go_is_drawn_as_a_level_out(no_go: tuple[ivl.World, Trace]) -> None:
    world, trace = no_go
    figure = figure_of(strobe.draw, world, trace, [])
    left, right = figure.axes[:2]
    assert (left.get_title(), right.get_title()) == ("approach and rise", "level-out")
    text = figure._suptitle.get_text()
    assert "no_go" in text
    assert ("below 0.01" if trace.outcome.p_land < 0.01 else f"{trace.outcome.p_land:.2f}") in text
    assert f"{1000 * trace.outcome.d_min_m:.0f} mm" in text
    labels = [entry.get_text() for entry in figure.legends[0].get_texts()]
    assert [label.split(",")[0] for label in labels] == ["no-go", "closest"]
    decided_s = world.called_off_s(trace)
    assert world.phase_name(int(trace.rows.phase[np.searchsorted(trace.rows.t_s, decided_s)])) == "level_out"
    assert f"{decided_s:.3f}" in labels[0]
    # the rightmost panel begins at the closest point and stays clear of the ceiling
    heights = np.concatenate([line.get_ydata() for line in right.lines if len(line.get_ydata()) == 2])
    assert heights.max() <= 0.0


def test_a_flight_that_goes_on_is_not_called_off() -> None:
    world = Place.of(TASK).world
    trace = world.trace(2.5, 60.0, *policies.good_theta(), form="polynomial2", start="flown")
    assert np.isnan(world.called_off_s(trace))


def test_the_verdict_says_what_happened(no_go: tuple[ivl.World, Trace]) -> None:
    record = no_go[1].outcome.copy()
    record.p_land = 0.004
    assert verdict(record).startswith("no_go at P below 0.01, closest ")
    record.p_land = 0.234
    near = f"closest {1000 * record.d_min_m:.0f} mm to the ceiling"
    assert verdict(record) == f"no_go at P = 0.23, {near}"
    record.body_contact = 1
    assert verdict(record).endswith("ceiling, body contact")
    record.no_go, record.n_legs = 0, 4
    assert verdict(record) == "4 feet stuck, body contact"
    record.body_contact = 0
    assert verdict(record) == "4 feet stuck, clean"
    record.base_contact, record.n_legs = 1, 0
    assert verdict(record) == "no foot stuck, body contact"


# ---- commands


@pytest.fixture
def path(tmp_path: Path) -> Path:
    file.save(policies.by_hand(), tmp_path / "g.yaml")
    return tmp_path / "g.yaml"


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_show_draws_the_surface(path: Path, suffix: str, capsys: Capture) -> None:
    picture = path.with_name(f"p.{suffix}")
    assert cli.run(["policy", "show", str(path), "--plot", str(picture)]) == 0
    assert picture.stat().st_size > 5000
    assert "polynomial2" in capsys.readouterr().out


def test_show_draws_all_pictures_into_a_folder(path: Path, capsys: Capture) -> None:
    folder = path.with_name("pictures")
    assert cli.run(["policy", "show", str(path), "--plot", str(folder), "--approaches", "4", "--json"]) == 0
    names = {f"{picture.name}{suffix}" for picture in pictures.PICTURES for suffix in (".png", ".pdf")}
    assert {file.name for file in folder.iterdir()} == names
    assert len(names) == 8
    assert json.loads(capsys.readouterr().out)["form"] == "polynomial2"


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (["--plot", "p.gif"], "--plot p.gif: unknown kind of file"),
        (["--plot", "missing/p.png"], "missing/p.png: the figure cannot be written"),
        (["--approaches", "10"], "--approaches: is for --plot with a folder"),
        (["--plot", "p.png", "--seed", "3"], "--seed: is for --plot with a folder"),
        (["--plot", "pictures", "--rrev", "4.8"], "--moment is missing"),
        (["--plot", "pictures", "--rrev", "4.8", "--moment", "800"], "out of range"),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_one_line(path: Path, more: list[str], told: str, capsys: Capture) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(path.parent)
        assert cli.run(["policy", "show", str(path), *more]) == 2
    error = capsys.readouterr().err
    assert told in error
    assert "Traceback" not in error


@pytest.mark.parametrize("arguments", [["show", "{}", "--plot", "p.png"], ["report", "{}", "--out", "p.html"]])
def test_a_policy_for_one_approach_has_no_surface(tmp_path: Path, arguments: list[str], capsys: Capture) -> None:
    paper = file.make(forms.by_name("constant"), [4.8, 8.0], [TASK], None, None)
    file.save(paper, tmp_path / "c.yaml")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path)
        assert cli.run(["policy", *(a.format(tmp_path / "c.yaml") for a in arguments)]) == 2
    assert "is not for every approach" in capsys.readouterr().err


def test_rollout_says_and_draws_a_no_go(path: Path, capsys: Capture) -> None:
    picture = path.with_name("no_go.png")
    said = ["--speed", "0.8", "--angle", "85", "--plot", str(picture)]
    assert cli.run(["rollout", "--policy", str(path), *said, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["verdict"].startswith("no_go at P ")
    assert f" {1000 * told['d_min_m']:.0f} mm " in told["verdict"]
    assert picture.stat().st_size > 10_000
