import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import planes
import pytest
from planes import MOVING, NORMALS

import ivl
from ivl import run
from ivl.errors import ConfigError
from ivl.plots import convergence, strobe, style
from ivl.world import Trace, rotation


@pytest.fixture
def result(small_run: run.RunResult, finished: Path) -> run.RunResult:
    return replace(small_run, folder=finished)


def is_picture(path: Path) -> bool:
    head = path.read_bytes()[:300]
    return {".png": head.startswith(b"\x89PNG"), ".svg": b"<svg" in head, ".pdf": head.startswith(b"%PDF")}[path.suffix]


def test_convergence_and_last_landing_are_drawn_into_the_run_folder(result: run.RunResult) -> None:
    files = [*convergence.draw_run(result), *strobe.draw_last_landing(result)]
    names = ["convergence.png", "convergence.svg", "last_landing.png", "last_landing.svg"]
    assert [file.name for file in files] == names
    assert all(file.parent == result.folder and is_picture(file) for file in files)


def test_every_scored_rollout_has_exactly_one_colour(result: run.RunResult) -> None:
    masks = np.array(convergence.outcome_classes(result.rollouts))
    assert (masks.sum(axis=0) == (result.rollouts.status == "scored")).all()


def test_equal_runs_give_equal_svg_files(result: run.RunResult, tmp_path: Path) -> None:
    files = [
        convergence.draw(result.experiment, result.history, result.rollouts, [tmp_path / f"{k}.svg"]) for k in "ab"
    ]
    assert files[0][0].read_bytes() == files[1][0].read_bytes()


@pytest.mark.parametrize(
    "arguments",
    [
        {"rrev_c_per_s": 4.8, "moment_y_Nmm": 8.0},
        {"rrev_c_per_s": 20.0, "moment_y_Nmm": 1.0},
        {"rrev_c_per_s": 0.0, "moment_y_Nmm": 10.0},
        {"rrev_c_per_s": 4.8, "moment_y_Nmm": 8.0, "start": "flown"},
        {"rrev_c_per_s": 4.8, "moment_y_Nmm": 8.0, "start": "at_trigger", "d_ceil_m": 0.5},
    ],
)
def test_a_landing_or_a_miss_can_be_drawn(world: ivl.World, arguments: dict[str, float], tmp_path: Path) -> None:
    trace = world.trace(2.5, 60.0, **arguments)  # type: ignore[arg-type]
    (file,) = strobe.draw(world, trace, [tmp_path / "landing.pdf"])
    assert is_picture(file)


def test_the_drawn_legs_have_the_length_of_the_legs(world: ivl.World) -> None:
    trace = world.trace(2.5, 90.0, 4.8, 8.0)
    row = trace.rows[len(trace.rows) // 2]
    values = world.params.values
    hips_B = np.column_stack([values["leg.hip_xy"] * strobe._LEG_SIGNS, np.full(4, values["leg.hip_z"])])
    hips_W = row.p_WB_m + hips_B @ rotation(row.q_WB).T
    lengths_m = np.linalg.norm(row.foot_W_m.reshape(4, 3) - hips_W, axis=1)
    assert lengths_m == pytest.approx(np.full(4, values["leg.length"]), abs=1e-4)


@pytest.mark.parametrize("name", ["missing/x.png", "x.unknown"])
def test_a_figure_that_cannot_be_written_is_named(tmp_path: Path, name: str) -> None:
    with pytest.raises(ConfigError, match="the figure cannot be written"):
        style.drawing(lambda: style.save(style.new_figure(1, 1), [tmp_path / name]))()
    assert list(tmp_path.iterdir()) == []


def test_a_picture_has_the_same_bytes_whatever_the_settings_around_it(tmp_path: Path) -> None:
    code = (
        "import sys, pathlib\n"
        "from ivl.plots import style\n"
        "import matplotlib as mpl\n"
        "mpl.rcParams.update({'font.size': 30, 'axes.grid': True} if sys.argv[2] == 'odd' else {})\n"
        "before = dict(mpl.rcParams)\n"
        "@style.drawing\n"
        "def draw(folder):\n"
        "    figure = style.new_figure(2, 2)\n"
        "    figure.subplots().plot([1, 3, 2], label='x')\n"
        "    return style.save(figure, [folder / f'p{s}' for s in ('.png', '.svg', '.pdf')])\n"
        "draw(pathlib.Path(sys.argv[1]))\n"
        "assert dict(mpl.rcParams) == before\n"
    )
    (tmp_path / "matplotlibrc").write_text("lines.linewidth: 9\nsavefig.bbox: tight\ntext.usetex: True\n")
    cases = {
        "plain": {},
        "odd": {"MPLBACKEND": "module://matplotlib_inline.backend_inline", "MATPLOTLIBRC": str(tmp_path)},
    }
    for name, environment in cases.items():
        (tmp_path / name).mkdir()
        command = [sys.executable, "-c", code, str(tmp_path / name), name]
        subprocess.run(command, check=True, env={**os.environ, **environment})
    for suffix in (".png", ".svg", ".pdf"):
        assert (tmp_path / "plain" / f"p{suffix}").read_bytes() == (tmp_path / "odd" / f"p{suffix}").read_bytes()


def drawn(world: ivl.World, trace: Trace, monkeypatch: pytest.MonkeyPatch) -> list[tuple[list[np.ndarray], list[str]]]:
    """Lines of each panel as they were drawn, and its labels and texts."""
    figures = []
    monkeypatch.setattr(style, "save", lambda figure, paths: figures.append(figure) or list(paths))
    strobe.draw(world, trace, [])
    panels = figures[0].axes[:2]
    words = [[axis.get_xlabel(), axis.get_ylabel(), *(text.get_text() for text in axis.texts)] for axis in panels]
    return [([line.get_xydata() for line in axis.lines], text) for axis, text in zip(panels, words, strict=True)]


@pytest.mark.parametrize("velocity", [(0.0, 0.0, 0.0), MOVING])
@pytest.mark.parametrize("normal", NORMALS)
def test_a_landing_at_any_surface_is_drawn_as_it_is_seen_from_there(
    world: ivl.World, normal: str, velocity: tuple[float, float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    trace = world.trace(2.5, 60.0, 4.8, 8.0)
    seen = planes.Seen(world, NORMALS[normal], velocity)
    known = drawn(world, trace, monkeypatch)
    other = drawn(seen.world, Trace(seen.rows(trace.rows), trace.outcome), monkeypatch)
    for (lines, _), (again, words) in zip(known, other, strict=True):
        assert len(again) == len(lines) > 50
        for line, same in zip(lines, again, strict=True):
            assert same == pytest.approx(line, abs=1e-9)
        assert ("g" in words) == (normal != "level")
        assert ("x (m)" in words) == (normal == "level")
