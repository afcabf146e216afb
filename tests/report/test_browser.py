"""The pages in a real browser: they load, move, answer clicks and keys, and ask nobody for anything."""

from typing import Any

import numpy as np
import pytest

import ivl
from ivl.landing import LandingSpec
from ivl.plots.spaces import RATE_MAP

Visit = Any  # of conftest.py
INSIDE = """(path) => {
    const box = path.getBBox(), inside = [];
    for (let i = 1; i < 20; i++) for (let j = 1; j < 20; j++) {
        const point = new DOMPoint(box.x + i * box.width / 20, box.y + j * box.height / 20);
        if (path.isPointInFill(point)) inside.push(point);
    }
    const middle = inside[Math.floor(inside.length / 2)].matrixTransform(path.getScreenCTM());
    return [middle.x, middle.y];
}"""
"""A point on the screen inside of a drawn sector, whatever its shape."""


def test_pages_load_and_draw_without_error(learn: Visit, sweep: Visit) -> None:
    assert learn.complaints == []
    assert sweep.complaints == []
    assert learn.page.locator("#convergence-plot .main-svg").count() > 0
    assert sweep.page.locator("#polar-plot .polarlayer > g").count() == 2
    assert sweep.page.locator("#region-plot canvas").count() > 0
    assert sweep.page.locator("#problem").is_hidden()


def test_slider_moves_the_vehicle_in_both_views(learn: Visit) -> None:
    learn.set_time(-100)
    before = [learn.drawn(pane) for pane in (0, 1)]
    learn.set_time(40)
    after = [learn.drawn(pane) for pane in (0, 1)]
    for old, new in zip(before, after, strict=True):
        assert np.abs(np.array(old["feet"]) - np.array(new["feet"])).max() > 20  # pixels
    learn.set_time(-100)
    assert [learn.drawn(pane) for pane in (0, 1)] == before


def test_the_slider_answers_keys(learn: Visit) -> None:
    learn.set_time(0)
    learn.page.locator("#time").focus()
    learn.page.keyboard.press("PageUp")
    assert float(learn.page.locator("#time").input_value()) > 0


def test_what_is_drawn_is_what_was_simulated(learn: Visit) -> None:
    packed = learn.page.evaluate("({spec: report.replay.panes[0].landing.spec, t0: report.replay.panes[0].landing.t0})")
    numbers = {name: int(packed["spec"][name]) for name in ("seed", "stream")}
    _, trace = LandingSpec(**{**packed["spec"], **numbers}).fly()
    ceiling_m = ivl.World(gear_set="as_simulated").params.values["world.ceiling_height"]
    first = int(np.searchsorted(trace.rows.t_s, packed["t0"] - 0.25))
    for row in trace.rows[first : first + 450 : 25]:
        shown = learn.page.evaluate(f"stateAt(report.replay.panes[0].landing, {float(row.t_s)!r})")
        assert shown["pose"]["p"] == pytest.approx(row.p_WB_m - [0, 0, ceiling_m], abs=6e-4)
        feet = np.array([foot["place"] for foot in shown["feet"]])
        assert feet == pytest.approx(row.foot_W_m.reshape(4, 3) - [0, 0, ceiling_m], abs=2e-3)
        assert [foot["state"] for foot in shown["feet"]] == row.foot_state.tolist()
        assert shown["pitch"] == pytest.approx(row.pitch_deg, abs=0.6)


def test_play_runs_to_a_pause(learn: Visit) -> None:
    learn.set_time(-170)
    learn.page.select_option("#speed", "0.2")  # seconds to the end, however late the second click comes
    learn.page.click("#play")
    learn.page.wait_for_function("Number(document.querySelector('#time').value) > -150")
    learn.page.click("#play")
    stopped_at = learn.page.locator("#time").input_value()
    learn.page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert learn.page.locator("#time").input_value() == stopped_at
    assert "play" in learn.page.locator("#play").inner_text()


def test_auto_speed_is_slow_between_trigger_and_contact(learn: Visit) -> None:
    rates = learn.page.evaluate(
        "(() => { const r = report.replay; r.speed.value = 'auto'; "
        "return [-0.2, 0.02, r.slowTo - 0.01, r.slowTo + 0.01].map((t) => { r.at = t; return r.rate(); }); })()"
    )
    assert rates == [0.25, 0.04, 0.04, 0.25]


def test_dragging_and_keys_turn_both_views(learn: Visit) -> None:
    learn.page.click("#view-reset")
    before = [learn.drawn(pane) for pane in (0, 1)]
    learn.page.locator("#canvas-a").press("ArrowLeft")
    after = [learn.drawn(pane) for pane in (0, 1)]
    assert before[0]["feet"] != after[0]["feet"]
    assert before[1]["feet"] != after[1]["feet"]
    learn.page.click("#view-reset")
    assert [learn.drawn(pane) for pane in (0, 1)] == before


def test_a_dot_of_the_convergence_opens_its_rollout(learn: Visit) -> None:
    dots = learn.page.locator("#convergence-plot .scatterlayer .points path.point")
    shown = set()
    for i in range(0, dots.count(), 7):
        dots.nth(i).scroll_into_view_if_needed()
        box = dots.nth(i).bounding_box()
        assert box is not None
        learn.page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        shown.add(learn.page.locator("#title-a").inner_text())
    assert len(shown) > 2
    assert all(title.startswith("rollout ") for title in shown)


def test_a_click_on_a_polar_plot_opens_the_cell(sweep: Visit) -> None:
    sectors = sweep.page.locator("#polar-plot .barlayer path")
    assert sectors.count() == 12
    sweep.page.evaluate(
        "document.querySelector('#polar-plot').on('plotly_hover', (e) => { window.under = e.points[0].customdata; })"
    )
    titles, landings = set(), set()
    for i in range(sectors.count()):
        sweep.page.evaluate("window.under = null")
        place = sectors.nth(i).evaluate(INSIDE)
        sweep.page.mouse.move(*place)
        sweep.page.wait_for_function("window.under !== null")  # the library finds the sector a moment after the mouse
        sweep.page.mouse.click(*place)
        assert sweep.page.evaluate("report.view.cell.id === window.under")
        titles.add(sweep.page.locator("#cell-title").inner_text())
        landings.add(sweep.number_of(0))
        assert sweep.page.locator("#trials-table tbody tr").count() == 2
    assert len(titles) == len(landings) == 12
    assert sweep.complaints == []


def test_the_page_begins_with_the_best_cell_nearest_to_the_middle(sweep: Visit) -> None:
    first = sweep.page.evaluate("report.view.firstShown()")
    cells = sweep.page.evaluate("report.view.cells")
    best = [cell for cell in cells if cell["rate"] == max(c["rate"] for c in cells)]
    off = [abs(cell["speed"] / 2 - 0.5) + abs(cell["angle"] / 3 - 0.5) for cell in best]
    assert first["id"] == best[int(np.argmin(off))]["id"]


@pytest.mark.parametrize("leg_length_m", [0.05, 0.1, 0.15])
def test_feet_and_ceiling_are_in_view_whatever_the_legs_and_the_distance(sweep: Visit, leg_length_m: float) -> None:
    script = """([leg, d]) => {
        const state = { pose: { p: [0, 0, -d] } }, view = { azimuth: -0.35, elevation: -0.2, zoom: 1 };
        const camera = makeCamera(view, { leg_length: leg }, state, 500, 390);
        return [camera.project([0, 0, -d - 0.005 - leg])[1], camera.project([0, 0, 0])[1]];
    }"""  # a foot straight below the body, its hip 5 mm below the middle
    for d_m in (0.06, 0.2, 0.5, 0.9):
        foot, ceiling = sweep.page.evaluate(script, [leg_length_m, d_m])
        assert 0 < ceiling < foot < 390


def test_rates_have_the_colours_of_the_figures(sweep: Visit) -> None:
    scale = sweep.page.evaluate(
        "(() => { const axis = document.querySelector('#polar-plot').layout.coloraxis; "
        "return [axis.colorscale, axis.reversescale]; })()"
    )
    name = scale[0].lower() + ("_r" if scale[1] else "")
    assert name == RATE_MAP


def test_what_is_told_of_the_sensed_distance_is_the_world_s(sweep: Visit) -> None:
    offset_m = ivl.World(gear_set="as_simulated").params.values["world.sensed_gap_offset"]
    assert f"a plane {1000 * offset_m:.0f} mm behind the ceiling" in sweep.page.locator("#offset").inner_text()


def test_menus_open_a_cell_without_a_mouse(sweep: Visit) -> None:
    sweep.page.select_option("#gear", label="wide long")
    sweep.page.select_option("#speed-choice", label="2.5 m/s")
    sweep.page.select_option("#angle-choice", label="90°")
    assert sweep.page.locator("#cell-title").inner_text() == "wide long, 2.5 m/s at 90°"
    assert sweep.page.locator("#title-a").inner_text().startswith("wide long, 2.5 m/s at 90°")


def test_the_table_of_a_cell_replays_in_either_view(sweep: Visit) -> None:
    sweep.page.locator("#trials-table tbody tr").nth(1).locator("button").nth(1).press("Enter")
    assert sweep.page.locator("#title-b").inner_text().endswith("trial 1")
    sweep.page.locator("#gears-table tbody tr").nth(0).locator("button").nth(0).press("Enter")
    assert sweep.page.locator("#title-a").inner_text().startswith("narrow short")


def test_the_region_can_be_coloured_by_a_parameter_of_the_policy(sweep: Visit) -> None:
    colours = []
    for choice in ("rate", "1"):  # the moment
        sweep.page.select_option("#region-colour", choice)
        colours.append(sweep.page.evaluate("Array.from(document.querySelector('#region-plot').data[0].marker.color)"))
    assert len(colours[0]) == len(colours[1]) > 0
    assert max(colours[0]) <= 1 < max(colours[1])


def test_everything_that_can_be_operated_has_a_name(sweep: Visit) -> None:
    nameless = sweep.page.evaluate(
        "Array.from(document.querySelectorAll('main button, main select, main input, main canvas[tabindex]')).filter("
        "(e) => !e.getAttribute('aria-label') && !e.textContent.trim() && !(e.labels && e.labels.length)).length"
    )
    assert nameless == 0


def test_nothing_is_asked_of_anybody(learn: Visit, sweep: Visit) -> None:
    assert learn.foreign == []
    assert sweep.foreign == []
    refused = sweep.page.evaluate("fetch('https://example.org').then(() => 'answered', () => 'refused')")
    assert refused == "refused"
    assert sweep.foreign == []  # the page's own policy stops it before the browser asks
    sweep.complaints.clear()


def test_the_page_of_a_policy_shows_its_pictures_and_a_no_go(policy: Visit) -> None:
    assert policy.complaints == policy.foreign == []
    assert policy.page.locator("#problem").is_hidden()
    assert policy.page.locator("#convergence").is_hidden()
    sizes = policy.page.evaluate("[...document.querySelectorAll('#pictures-list img')].map((i) => i.naturalWidth)")
    assert len(sizes) == 4
    assert min(sizes) > 300
    assert policy.page.locator("#numbers-table tbody tr").count() > 8
    assert policy.page.locator("#title-a").inner_text() == "landing"
    assert policy.page.locator("#title-b").inner_text() == "no-go"
    assert policy.page.locator("#verdict-b").inner_text().startswith("no_go at P ")
    assert policy.page.locator("#zero").inner_text() == "from the trigger (A), the no-go (B)"


def test_a_no_go_is_replayed_from_its_approach_through_its_level_out(policy: Visit) -> None:
    policy.set_time(-50)
    before = policy.drawn(1)
    assert policy.page.locator("#phase-b").inner_text() == "approach"
    policy.set_time(60)
    assert policy.page.locator("#phase-b").inner_text() == "level_out"
    assert policy.drawn(1)["body"] != before["body"]
    last_ms = float(policy.page.locator("#time").get_attribute("max") or 0)
    policy.set_time(last_ms)
    assert policy.page.locator("#phase-b").inner_text() == "level_out"
    gap = policy.page.evaluate("-report.replay.panes[1].state.pose.p[2]")
    assert gap > 0.1


def test_the_buttons_of_a_policy_s_flights_show_what_the_no_go_spared(policy: Visit) -> None:
    rows = policy.page.locator("#notable-table tbody tr")
    assert rows.count() == 3
    rows.nth(2).locator("button").nth(0).click()
    assert policy.page.locator("#title-a").inner_text() == "the same approach, had it been flown"
    assert not policy.page.locator("#verdict-a").inner_text().startswith("no_go")
