"""docs/SITE.md says what the code does: fields, checks, states, words, numbers."""

import re
from pathlib import Path

from ivl import experiment, files, yamlfile
from ivl.links import forecast, tracking
from ivl.links.sites import room
from ivl.links.trouble import STATES
from ivl.rehearsal.script import FAULTS
from ivl.site import checks
from ivl.site import file as site_file
from ivl.site.file import MEASURED, SiteFile

PAGE = (Path(__file__).parents[2] / "docs" / "SITE.md").read_text(encoding="utf-8")
TEXT = " ".join(PAGE.split())


def test_states_are_those_of_the_code() -> None:
    table = PAGE.partition("## The day")[2].partition("## ")[0]
    rows = re.findall(r"^\| ([^|]+) \| ([^|]+) \| ([^|]+) \| ([^|]+) \|$", table, re.MULTILINE)
    told = rows[rows.index(("state", "noticed by", "the operator is asked to", "left when")) + 1 :]
    assert told == [(state.cause, state.seen, state.asks or "-", state.leaves) for state in STATES]


def test_checks_are_those_of_the_code(tmp_path: Path) -> None:
    files.write_new(tmp_path / "lab.yaml", site_file.TEMPLATE.read_bytes())
    site = site_file.load(str(tmp_path / "lab.yaml"))
    made = checks.checks(site, experiment.load("experiments/paper_flight.yaml", site=str(tmp_path / "lab.yaml")))
    table = PAGE.partition("## Checks of a site")[2].partition("## ")[0]
    told = [name for row in re.findall(r"^\| ([^|]+) \|", table, re.MULTILINE) for name in row.split(", ")]
    assert told[1:] == [check.name for check in made]


def test_faults_of_a_rehearsed_day_are_those_of_the_code() -> None:
    table = PAGE.partition("## The rehearsed day")[2].partition("## ")[0]
    told = re.findall(r"^\| `(\w+)` \| ([^|]+) \| ([^|]+) \|$", table, re.MULTILINE)
    assert told == [(row.kind, row.happens, row.cause or "-") for row in FAULTS]


def test_every_field_is_told() -> None:
    fields = [path for path in yamlfile.paths(SiteFile) if not path.startswith("mocap.")]
    told = PAGE.partition("## Fields")[2].partition("## ")[0]
    groups = {path.partition(".")[0] for path in fields if "." in path}
    named = [path for path in fields if path not in (*groups, "name", "doc")]
    assert [path for path in named if f"`{path.rpartition('.')[2]}`" not in told and f"`{path}`" not in told] == []
    assert set(MEASURED) <= set(fields)


def test_numbers_are_those_of_the_code() -> None:
    for text in (
        f"within {tracking.HOME_M:g} m, before it is armed",
        f"{checks.FENCE_MARGIN_M:g} m inside the fence",
        f"along the approach {checks.FLIP_S:g} s of its speed more",
        f"full duty is {checks.HOVER_RESERVE:g} of the weight",
        f"expects of {forecast.N} landings",
        f"how many of {forecast.N} land",
        f"estimate is within {1e3 * tracking.AGREES_M:.0f} mm of",
    ):
        assert text in TEXT, text
    assert room.AWAY_S == 120.0, "two minutes"
