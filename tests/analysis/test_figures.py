import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from ivl.cli import run
from ivl.errors import ConfigError, StoreError
from ivl.layout import layout_of
from ivl.plots import campaign, fig04_convergence, fig09_gears, paper, style
from ivl.plots.campaign import Campaign
from ivl.sweep import config, schema

LAYOUT = layout_of(config.load_sweep("sweeps/paper.yaml"))
Trials = Callable[..., pd.DataFrame]
SPEEDS, ANGLES = (1.0, 2.0, 2.5, 3.0, 4.0), (20.0, 45.0, 70.0, 90.0)


def make_episodes(trials: pd.DataFrame, n: int = 6) -> pd.DataFrame:
    """Episodes of the trials, every column of the schema: mu walks from 4 to the trial's own, sigma shrinks."""
    rows = trials.loc[trials.index.repeat(n), list(schema.TRIAL_KEY)].reset_index(drop=True)
    episode = np.tile(np.arange(n), len(trials))
    share = episode / (n - 1)
    frame = pd.DataFrame({f.name: np.zeros(len(rows)) for f in schema.schema(schema.EPISODES, LAYOUT)})
    return frame.assign(**{c: rows[c] for c in rows}).assign(
        episode=episode,
        n_scored=8,
        mu_rrev_c_per_s=4 + share,
        mu_moment_y_Nmm=5 + 3 * share,
        sigma_rrev_c_per_s=1.5 - share,
        sigma_moment_y_Nmm=1.5 - share,
        landing_rate_four_leg_norm=share,
    )


@pytest.fixture
def data(trials: Trials) -> Campaign:
    def fast_lands(c: pd.DataFrame) -> np.ndarray:
        return np.clip(c.v / 3 - 0.02 * c.k, 0, 1)

    parts = [
        trials(SPEEDS, ANGLES, rate=fast_lands, rrev=4 + 0.2 * i, gear=gear, learner=learner)
        for i, (gear, learner) in enumerate([("wide_short", "bo"), ("wide_short", "ephe"), ("wide_long", "bo")])
    ]
    frame = pd.concat(parts, ignore_index=True)
    frame["recommended_moment_y_Nmm"] = 4 + frame["speed_mps"] + 0.1 * frame["trial"]
    return Campaign(frame, make_episodes(frame))


def is_picture(path: Path) -> bool:
    head = path.read_bytes()[:300]
    return {".png": head.startswith(b"\x89PNG"), ".svg": b"<svg" in head, ".pdf": head.startswith(b"%PDF")}[path.suffix]


def test_all_figures_are_drawn_in_vector_form_and_png(data: Campaign, tmp_path: Path) -> None:
    drawn = paper.draw_all(data, tmp_path / "figures", dpi=60)
    assert [p.name for p in drawn.files] == [f"{f.name}{s}" for f in paper.FIGURES for s in (".pdf", ".png")]
    assert all(is_picture(path) for path in drawn.files)
    assert not drawn.left_out


def words(figure: Figure) -> list[Text]:
    """Titles, labels, legends and notes of a figure; not the ticks, of which some lie outside and are not drawn."""
    legends = [*figure.legends, *(axis.get_legend() for axis in figure.axes if axis.get_legend())]
    found = [*figure.texts, *(text for legend in legends for text in legend.get_texts())]
    for axis in figure.axes:
        found += [axis.title, axis.xaxis.label, axis.yaxis.label, *axis.texts]
    return [text for text in found if text.get_text().strip()]


@pytest.mark.parametrize("learners", [["bo"], ["bo", "ephe"]])
def test_no_word_of_a_figure_is_cut_off(
    data: Campaign, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, learners: list[str]
) -> None:
    figures: list[Figure] = []
    monkeypatch.setattr(style, "save", lambda figure, paths, _dpi: figures.append(figure) or list(paths))
    some = Campaign(*(table[table["learner"].isin(learners)] for table in (data.trials, data.episodes)))
    paper.draw_all(some, tmp_path, names=["fig04", "fig06", "fig09"])
    assert len(figures) == 3
    for figure in figures:
        figure.draw_without_rendering()
        for part in [*figure.legends, *words(figure)]:
            box = part.get_window_extent()
            assert min(box.x0, box.y0) >= -1, part
            assert box.x1 <= figure.bbox.x1 + 1, part
            assert box.y1 <= figure.bbox.y1 + 1, part


def test_equal_campaigns_give_equal_svg_files(data: Campaign, tmp_path: Path) -> None:
    first, second = (paper.draw_all(data, tmp_path / k, suffixes=[".svg"], names=["fig05"]) for k in "ab")
    assert first.files[0].read_bytes() == second.files[0].read_bytes()


def test_fewer_dots_make_smaller_pictures(data: Campaign, tmp_path: Path) -> None:
    coarse, fine = (
        paper.draw_all(data, tmp_path / f"{dpi}", suffixes=[".png"], names=["fig09"], dpi=dpi).files[0]
        for dpi in (50, 100)
    )
    assert coarse.stat().st_size < fine.stat().st_size


def test_a_campaign_without_landings_says_what_it_cannot_show(data: Campaign, tmp_path: Path) -> None:
    poor = Campaign(data.trials.assign(landing_rate_four_leg_norm=0.1), data.episodes.iloc[:0])
    drawn = paper.draw_all(poor, tmp_path, suffixes=[".svg"])
    assert sorted(drawn.left_out) == ["fig04_convergence", "fig08_moment"]
    assert len(drawn.files) == 4
    blind = Campaign(poor.trials.assign(n_triggered=0), poor.episodes)
    assert [p.stem for p in paper.draw_all(blind, tmp_path, suffixes=[".svg"]).files] == ["fig09_gears"]


def test_the_preferred_part_is_the_papers_gear_and_the_default_learner(data: Campaign) -> None:
    part = data.preferred(*campaign.SETUP)
    assert part.title("gear", "gear_set", "vehicle", "learner") == "Wide-Short, table1, habas2021, bo"
    assert data.select(gear="wide_long").preferred("gear").title("gear") == "Wide-Long"


def test_a_choice_that_is_not_there_names_what_is(data: Campaign, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"gear: value 'wheels' is not in this run.*wide_long, wide_short"):
        paper.draw_all(data, tmp_path, {"gear": "wheels"})
    with pytest.raises(ConfigError, match=r"no figure 'fig99'.*fig04_convergence"):
        paper.draw_all(data, tmp_path, names=["fig99"])


def test_convergence_takes_the_cell_nearest_to_the_papers_experiment(data: Campaign) -> None:
    nearest = fig04_convergence._nearest(data.episodes)
    assert nearest[["speed_mps", "angle_deg"]].drop_duplicates().to_numpy().tolist() == [[2.5, 90.0]]
    away = data.episodes[data.episodes["speed_mps"] != 2.5]
    assert set(fig04_convergence._nearest(away)["angle_deg"]) == {90.0}


def test_disc_cells_reach_half_way_to_their_neighbours() -> None:
    assert fig09_gears._edges(np.array([1.0, 2.0, 4.0])).tolist() == [0.5, 1.5, 3.0, 5.0]
    assert fig09_gears._edges(np.array([2.0])).tolist() == pytest.approx([1.8, 2.2])


def test_failures_are_never_drawn_over_successes(data: Campaign) -> None:
    assert campaign.points(data.preferred(*campaign.SETUP))["rate_norm"].is_monotonic_increasing


def test_figures_of_a_real_sweep_from_the_command_line(
    fly: Callable[[config.Sweep, Path], Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = ["speeds_mps=[2.5, 4.0]", "angles_deg=[60.0, 90.0]", "gears=[wide_short]", "budget=32"]
    real_run = fly(config.load_sweep("sweeps/smoke.yaml", settings), tmp_path / "run")
    assert run(["figs", str(real_run), "--only", "fig09", "--only", "fig06", "--svg", "--json"]) == 0
    files = [Path(f) for f in json.loads(capsys.readouterr().out)["files"]]
    names = [f"{name}{suffix}" for name in ("fig06_flow_space", "fig09_gears") for suffix in (".svg", ".png")]
    assert files == [real_run / "figures" / name for name in names]
    assert all(is_picture(file) for file in files)


def test_a_folder_without_a_sweep_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(StoreError, match="holds no sweep"):
        campaign.load([tmp_path])
    assert run(["figs", str(tmp_path)]) == 1
    assert "holds no sweep" in capsys.readouterr().err
    (tmp_path / "manifest.json").write_text(json.dumps({"schema_version": schema.SCHEMA_VERSION, "map": {}}))
    with pytest.raises(ConfigError, match="is a policy map"):
        campaign.load([tmp_path])
