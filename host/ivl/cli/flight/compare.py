"""`ivl flight compare`."""

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import Progress

from ivl.cli import console
from ivl.cli.flight import options
from ivl.cli.task_options import Chosen
from ivl.errors import ConfigError
from ivl.world import World

HELP = """Compare recorded flights with the simulation of a vehicle.

Motion: each flip is flown once in the simulator, from the state that was recorded at the trigger; the differences up to
200 ms later are given as root mean squares. Outcome: the same flip is flown many times, scattered by what a recording
does not tell, and the share of simulated landings is compared with what happened. Window: landings from hover at the
moments that were flown, over RREV_c. A figure shows all of it.

\b
Examples:
  ivl flight compare flights/july
      crazyflie21 with Wide-Short; the figure goes into comparison.png
  ivl flight compare flights/july --policy 4.0,8.12 --json
      the landing rate of one more policy, for a script
  ivl flight compare flights/july --set sense.latency=0.02 --plot late.svg
      the same vehicle with slower sensing
"""
_SUFFIXES = (".png", ".svg", ".pdf")


@options.world_options
def compare(
    folder: options.Folder,
    chosen: Chosen,
    policy: Annotated[
        list[str] | None, typer.Option(metavar="RREV_C,M_YD", help="Also give this policy's landing rate, from hover.")
    ] = None,
    rollouts: Annotated[int, typer.Option("--n", help="Simulated landings for each flight.", min=1, max=10000)] = 64,
    plot: Annotated[Path | None, typer.Option(help="Draw into FILE (.png, .svg or .pdf).")] = None,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Compare; HELP is the text that people see."""
    library, _, store = options.flight_package()
    path = plot or (None if as_json else Path("comparison.png"))
    if path is not None and path.suffix not in _SUFFIXES:
        raise ConfigError(f"--plot {path}: unknown kind of file (allowed {', '.join(_SUFFIXES)})")
    if path is not None:
        options.check_parent("--plot", path)
    flights = store.read(folder)
    home = chosen.make_world()
    with Progress(console=console.err, transient=True) as progress:
        task = progress.add_task("flights", total=None)
        result = library.compare(
            flights, home, rollouts, seed, options.policies(policy),
            progress=lambda done, total: progress.update(task, completed=done, total=total),
        )  # fmt: skip
    summary = result.summary()
    if as_json:
        console.print_json(summary)
    else:
        _report(summary, _name(home))
    if path is not None:
        _draw(library, result, home, path)
        if not as_json:
            console.say(f"figure: {path}")


def _name(world: World) -> str:
    return f"{world.vehicle}, {world.gear_set}/{world.gear}"


def _draw(library: Any, result: Any, home: World, path: Path) -> None:
    from ivl.plots import flights as picture  # matplotlib takes a second to load

    worlds = [library.in_room(home, row.flip) for row in result.rows]
    picture.draw(result, worlds, [path], _name(home))


def _report(summary: dict[str, Any], name: str) -> None:
    def line(label: str, text: str) -> None:
        console.out.print(f"{label:34s} {text}")

    line("vehicle", name)
    line("flights compared", str(summary["n_flights"]))
    for text in summary["left_out"]:
        line("left out", text)
    line("pitch, rms to 200 ms", f"{summary['pitch_rms_deg']:.1f} deg")
    line("sensed height, rms to 200 ms", f"{1e3 * summary['height_rms_m']:.0f} mm")
    line("rate, rms to 200 ms", f"{summary['rate_rms_radps']:.1f} rad/s")
    if summary["t_contact_error_s"] is not None:
        line("contact, simulated - recorded", f"{1e3 * summary['t_contact_error_s']:+.0f} ms (median)")
    if summary["n_judged"]:
        _report_outcomes(summary, line)
    for window in summary["windows"]:
        simulated, flown = window["simulated_threshold_per_s"], window["landed_threshold_per_s"]
        text = f"simulated {_span(simulated)}, flown landings {_span(flown)} 1/s"
        line(
            f"window at {window['moment_Nmm']:.2f} N mm",
            f"{text}, at {window['speed_mps']:g} m/s and {window['angle_deg']:g} deg",
        )
    for one in summary["policies"]:
        line(f"rate at ({one['threshold_per_s']:g}, {one['moment_Nmm']:g}), from hover", f"{one['rate']:.2f}")


def _report_outcomes(summary: dict[str, Any], line: Any) -> None:
    if summary["landed_auc"] is None:
        line("landed or not: AUC", "unknown: it needs flights that landed and flights that did not")
    else:
        low, high = summary["landed_auc_95"]
        line("landed or not: AUC", f"{summary['landed_auc']:.2f} (95 %: {low:.2f} to {high:.2f})")
    low, high = summary["landed_brier_95"]
    line("landed or not: Brier score", f"{summary['landed_brier']:.3f} (95 %: {low:.3f} to {high:.3f})")
    rates = summary["rate_by_flown_legs"]
    text = ", ".join(f"{legs} feet {'-' if rate is None else f'{rate:.2f}'}" for legs, rate in rates.items())
    line("simulated rate of flights ended on", text)
    share = summary["two_leg_share"]
    line("endings on one or two feet", f"flown {share['flown']:.2f}, simulated {share['simulated']:.2f}")


def _span(span: list[float] | tuple[float, float] | None) -> str:
    return "none" if span is None else f"{span[0]:.2f} to {span[1]:.2f}"
