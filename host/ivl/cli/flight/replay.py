"""`ivl flight replay`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from ivl.cli import console
from ivl.cli.console import number, percent
from ivl.cli.flight import options
from ivl.cli.task_options import Chosen
from ivl.errors import ConfigError, IvlError
from ivl.links import pil

if TYPE_CHECKING:
    from ivl.flight.replay import Result

HELP = """Feed the recorded states of FLIGHTS to the flight core, tick by tick: the same cues, the same trigger?

FLIGHTS is a folder that `ivl flight import` wrote. Vehicle and gear give the core's configuration; the plane of the
cues and the policy are each flight's own.

\b
Examples:
  ivl flight replay flights/july
      a short table and the conclusion
  ivl flight replay flights/july --uri pil:// --json
      the core on an emulated STM32F405: "bits" is the same
  ivl flight replay flights/july --step 0.001 --plot replay.png
      the log was cut to three digits; some flights, drawn
  ivl flight replay flights/july --battery --set firmware.vbat_min=2.9
      would the rule about the battery have let them fly?
"""
_SUFFIXES = (".png", ".svg", ".pdf")
_CUES = (("rrev", "RREV, 1/s", "per_s"), ("of_y", "OF_y, rad/s", "radps"), ("d_ceil", "distance, m", "m"))
_EVENTS = (("trigger", "trigger, samples"), ("cut", "motors off, samples"))


@options.world_options
def replay(
    folder: options.Folder,
    chosen: Chosen,
    uri: Annotated[
        str | None, typer.Option(help="Where the core runs: pil:// or pil:///path/of/image.elf; default: here.")
    ] = None,
    battery: Annotated[bool, typer.Option("--battery", help="Tell the core of the logged battery.")] = False,
    step: Annotated[float, typer.Option(help="Numbers in the log are multiples of this, in SI units.", min=0.0)] = 0.0,
    plot: Annotated[Path | None, typer.Option(help="Draw some flights into FILE (.png, .svg or .pdf).")] = None,
    as_json: options.Json = False,
) -> None:
    """Replay recorded flights; HELP is the text that people see."""
    if plot and plot.suffix not in _SUFFIXES:
        raise ConfigError(f"--plot {plot}: unknown kind of file (allowed {', '.join(_SUFFIXES)})")
    world = chosen.make_world()
    chips = _chips(uri) if uri else None
    try:
        from ivl.flight import replay as core  # pyarrow takes a while to load
        from ivl.flight import store
    except ModuleNotFoundError as error:
        raise IvlError(f"{error.name} is not installed: pip install 'ivl[flight]'") from error
    result = core.replay(store.read(folder), world, chips, battery, step)
    if plot:
        _draw(result, plot)
    if as_json:
        console.print_json(result.summary)
    else:
        _report(result)


def _chips(uri: str) -> pil.Chips:
    if not uri.startswith("pil://"):
        raise ConfigError(f"--uri {uri}: not a place where a core can be replayed (allowed pil://)")
    return pil.Chips(pil.qemu_command(pil.image_of(uri)))


def _draw(result: "Result", path: Path) -> None:
    from ivl.plots import replay as figure  # matplotlib takes a second to load

    figure.draw(result.flights, [path])


def _report(result: "Result") -> None:
    summary = result.summary
    console.out.print(
        f"{summary['n_flights']} flights, {summary['n_samples']} samples of approaches, {summary['n_ticks']} ticks "
        f"({summary['where']})",
    )
    console.out.print(_table(summary), soft_wrap=False)
    for label, reason in result.left_out:
        console.out.print(f"Left out: {label}: {reason}")
    for sentence in result.verdict():
        console.out.print(sentence)


def _table(summary: dict[str, Any]) -> Table:
    table = Table("difference", "samples", "median", "95 %", "largest", "within 0.003", box=None)
    for key, name, suffix in _CUES:
        row = summary[key]
        sizes = [number(row[f"{size}_error_{suffix}"], 4) for size in ("median", "q95", "max")]
        table.add_row(name, str(row["n"]), *sizes, percent(row.get("within_0_003")))
    for key, name in _EVENTS:
        table.add_row(name, str(summary[key]["n"]), *_spread(summary[key]["offsets_samples"]), "-")
    return table


def _spread(offsets: list[int]) -> list[str]:
    """Median, 95 % quantile and largest size of whole offsets."""
    sizes = sorted(abs(n) for n in offsets)
    if not sizes:
        return ["-", "-", "-"]
    return [str(sizes[int(share * (len(sizes) - 1))]) for share in (0.5, 0.95, 1.0)]
