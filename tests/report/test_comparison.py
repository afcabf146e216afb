"""`ivl report RUN RUN`: the page says of each run what its data frames say; all pages fit a phone."""

import json
import re
from pathlib import Path

import pytest
from playwright.sync_api import Browser

import ivl
from ivl import cli, experiment, run

PHONE = {"width": 390, "height": 844}


@pytest.fixture(scope="module")
def other_run(tmp_path_factory: pytest.TempPathFactory, learn_run: Path) -> Path:
    """The same task with another learner and less to fly."""
    data = ivl.load(learn_run).experiment.model_dump(mode="json")
    path = tmp_path_factory.mktemp("other") / "run"
    run.run(experiment.from_data({**data, "learner": {"name": "ephe"}, "budget": 16}, "other.yaml"), path)
    return path


@pytest.fixture(scope="module")
def page(learn_run: Path, other_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "both.html"
    assert cli.run(["report", str(learn_run), str(other_run), "--out", str(path)]) == 0
    return path


def test_the_page_says_what_differs_and_what_does_not(page: Path, learn_run: Path, other_run: Path) -> None:
    text = page.read_text(encoding="utf-8")
    rows = dict(re.findall(r"<tr><th>([^<]+)</th>(.*?)</tr>", text))
    cells = {name: re.findall(r"<td>([^<]*)</td>", row) for name, row in rows.items()}
    assert cells["learner"] == ["ephe_robust", "ephe"]
    assert cells["rollouts flown"] == ["24", "16"]
    flown = [ivl.load(folder).rollouts() for folder in (learn_run, other_run)]
    assert cells["of them landed"] == [f"{100 * (frame.n_legs >= 3).mean():.0f} %" for frame in flown]
    assert len(set(cells["run"])) == 2
    assert "<li>approach: 2.5 m/s, 90 deg</li>" in text
    assert "approach" not in cells
    assert text.count("data:image/png;base64,") == 2


def test_runs_that_cannot_be_compared_are_refused(
    learn_run: Path, sweep_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "page.html"
    assert cli.run(["report", str(learn_run), str(learn_run), "--out", str(out)]) == 2
    assert cli.run(["report", str(learn_run), str(sweep_run), "--out", str(out)]) == 2
    assert cli.run(["report", str(learn_run), str(tmp_path), "--out", str(out)]) == 1
    told = capsys.readouterr().err
    assert "a run is given twice" in told
    assert "only runs of ivl learn can be compared" in told
    assert not out.exists()


def test_a_script_is_told(learn_run: Path, other_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "page.html"
    assert cli.run(["report", str(learn_run), str(other_run), "--out", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"path": str(out), "size_bytes": out.stat().st_size, "runs": 2}


@pytest.mark.parametrize("name", ["page", "learn_page", "sweep_page"])
def test_a_page_is_not_wider_than_a_phone(name: str, browser: Browser, request: pytest.FixtureRequest) -> None:
    visit = browser.new_page(viewport=PHONE)
    visit.goto(request.getfixturevalue(name).resolve().as_uri())
    visit.wait_for_function("document.body.dataset.ready === 'true' || !document.querySelector('script')")
    assert visit.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    outside = visit.evaluate(
        """() => {
            // what lies in a box of its own that scrolls to the side, such as a wide table, can be reached
            const scrolls = e => e !== document.documentElement && e !== document.body
                && ["auto", "scroll"].includes(getComputedStyle(e).overflowX);
            const reached = e => e !== null && (scrolls(e) || reached(e.parentElement));
            return [...document.querySelectorAll("button, select, input")]
                .filter(e => e.offsetParent !== null && !reached(e.parentElement))
                .filter(e => e.getBoundingClientRect().right > window.innerWidth + 1)
                .map(e => e.id || e.textContent);
        }"""
    )
    assert outside == []
    visit.close()
