"""`ivl policy show`."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table

from ivl import native
from ivl.cli import console, policy_options
from ivl.cli.policy import survey_options
from ivl.errors import ConfigError
from ivl.policy import file
from ivl.policy.file import NONE, PolicyFile, Score, Training, WithGo
from ivl.policy.shape import General, is_general
from ivl.policy.survey import survey

HELP = """Show what a policy file holds: numbers, origin, score, and its threshold R* over the sensed velocities.

\b
Examples:
  ivl policy show g.yaml
      for people
  ivl policy show g.yaml --json
      the file and the table, for a script
  ivl policy show g.yaml --plot surface.png
      a picture of threshold and probability over the velocities
  ivl policy show g.yaml --plot pictures --approaches 2000
      a folder of pictures: the surface; landing rates beside those of the paper's policy and of the best of each cell;
      approaches in the flow space; go / no-go. They are flown for it, on what the policy was learned on
"""

_SUFFIXES = (".png", ".pdf")
"""Formats of the pictures in a folder."""
_SINGLE = (".png", ".svg", ".pdf")
_VX_MPS = np.arange(0.0, 4.01, 0.5)
_VZ_MPS = np.arange(0.5, 4.01, 0.5)


def show(
    path: Annotated[Path, typer.Argument(metavar="FILE", help="Policy file.")],
    plot: Annotated[
        Path | None,
        typer.Option(help="Draw the surface into a file (.png, .svg, .pdf), or all pictures into a folder."),
    ] = None,
    approaches: survey_options.Approaches = None,
    seed: survey_options.Seed = 0,
    rrev: policy_options.Rrev = None,
    moment: policy_options.Moment = None,
    threads: survey_options.Threads = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Show a policy; HELP is the text that people see."""
    policy = file.load(path)
    into_folder = plot is not None and (plot.is_dir() or not plot.suffix)
    said = {"approaches": approaches, "seed": seed or None, "rrev": rrev, "moment": moment, "threads": threads}
    for name, value in said.items():
        if value is not None and not into_folder:
            raise ConfigError(f"--{name}: is for --plot with a folder, for which alone flights are flown")
    if plot is not None and not into_folder:
        _draw_surface(policy, plot)
    elif plot is not None:
        constant, n = survey_options.constant_of(rrev, moment), approaches or survey_options.N_APPROACHES
        _draw_all(policy, plot, n, seed, constant, threads)
    if as_json:
        console.print_json({**policy.model_dump(mode="json"), "crc": f"{policy.checksum:08x}", "table": _table(policy)})
    else:
        _print(policy)


def _draw_surface(policy: PolicyFile, path: Path) -> None:
    if path.suffix not in _SINGLE:
        raise ConfigError(f"--plot {path}: unknown kind of file (allowed {', '.join(_SINGLE)}, or a folder)")
    from ivl.plots import policy_surface  # matplotlib takes a second to load

    policy_surface.draw(General(policy.form), np.array(policy.values), [path])


def _draw_all(
    policy: PolicyFile,
    folder: Path,
    n_approaches: int,
    seed: int,
    constant: tuple[float, float] | None,
    threads: int | None,
) -> None:
    from ivl.plots import policy as pictures
    from ivl.plots import style

    General(policy.form)
    style.make_folder(folder)
    with console.err.status("flying"):
        found = survey(policy, n_approaches, seed, constant, threads=threads)
        pictures.draw_all(found, folder, _SUFFIXES)


def _table(policy: PolicyFile) -> dict[str, Any] | None:
    """Threshold, moment and probability over the velocities, row by row of vz; None of a form for one approach."""
    if not is_general(policy.form):
        return None
    general = General(policy.form)
    vx, vz = np.meshgrid(_VX_MPS, _VZ_MPS)
    return {
        "vx_mps": _VX_MPS.tolist(),
        "vz_mps": _VZ_MPS.tolist(),
        "threshold_per_s": general.thresholds(policy.values, vx, vz).tolist(),
        "moment_Nmm": general.moments(policy.values, vx, vz).tolist(),
        "p_land": general.probabilities(policy.values, vx, vz).tolist(),
    }


def _print(policy: PolicyFile) -> None:
    form = policy.shape
    _line("form", f"{form.name}: {form.doc}")
    for p, value in zip(form.params, policy.values, strict=True):
        _line(f"  {p.name}", f"{value:.6g} {p.unit}")
    _print_origin(policy)
    found = _table(policy)
    if found is not None:
        _print_table(found)


def _print_origin(policy: PolicyFile) -> None:
    """Where the numbers come from, and how good they were found to be."""
    _line("checksum on a vehicle", f"{policy.checksum:08x}")
    if policy.digest == NONE:
        _line("digest", "none: written or changed by hand, so that origin and score need not be those of the numbers")
    elif policy.made_by != native.library().digest():
        _line("made by", "another version of the simulator, in which landing rates may differ")
    for task in policy.tasks:
        told = task.model_dump(mode="json", exclude_defaults=True)
        overrides = {name: setting["value"] for name, setting in told.pop("overrides", {}).items()}
        if told.pop("family", None):
            told["family"] = "with a section of its own"
        _line("learned on", ", ".join(f"{name} {value}" for name, value in {**told, **overrides}.items()))
    if policy.training is not None:
        _print_training(policy.training)
    if policy.score is not None:
        _print_score(policy.score)


def _print_training(t: Training) -> None:
    _line("learned by", f"{t.learner.name}, seed {t.seed}, {t.rollouts} flights{', interrupted' * t.interrupted}")
    if t.family is not None:
        _line("learned over", f"{t.family.n_vehicles} vehicles drawn in place of each (seed {t.family.seed})")
    for region in t.regions:
        (v0, v1), (a0, a1) = region.speeds_mps, region.angles_deg
        _line("approaches", f"{v0:g} to {v1:g} m/s, {a0:g} to {a1:g} degrees")
    _line("objective", f"{console.number(t.objective, 4)} (at the start {console.number(t.start_objective, 4)})")


def _print_score(s: Score) -> None:
    _line("score", f"{_rates(s)}, of {s.flights} approaches, {'every one flown' if s.with_go else 'none refused'}")
    if s.with_go is not None:
        _line("with go / no-go", f"{console.percent(s.with_go.refused)} of them are refused, {_rates(s.with_go)}")


def _rates(of: Score | WithGo) -> str:
    return f"{console.percent(of.landed)} land, {console.percent(of.clean)} clean"


def _print_table(found: dict[str, Any]) -> None:
    for name, title, digits in (
        ("threshold_per_s", "R* (1/s) over v_x (m/s, to the right) and v_z (m/s, down)", 2),
        ("p_land", "probability of a landing", 2),
    ):
        table = Table(title=title, title_justify="left", box=None, padding=(0, 1))
        table.add_column("v_z", justify="right")
        for vx in found["vx_mps"]:
            table.add_column(f"{vx:g}", justify="right")
        for vz, row in zip(found["vz_mps"], found[name], strict=True):
            table.add_row(f"{vz:g}", *(f"{value:.{digits}f}" for value in row))
        console.out.print()
        console.out.print(table, soft_wrap=False)


def _line(name: str, text: str) -> None:
    console.out.print(f"{name:24s} {text}", highlight=False, soft_wrap=True)
