"""`ivl flight identify`."""

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from ivl import files, yamlfile
from ivl.cli import console
from ivl.cli.flight import options
from ivl.cli.task_options import Chosen
from ivl.errors import ConfigError

HELP = """Identify a vehicle from the motion of recorded flights, and write it as a vehicle file.

The fit looks at pitch, rate and height after the trigger, at the time of the contact and at the height at which the
vehicle hung: never at whether it landed. The vehicle file gives the prior (value and sigma of each fitted parameter),
the parameter table the bounds. Intervals come from resampling whole flights. It names what the flights cannot separate.
What differs from the vehicle's file (--set) is held, and goes into the new file.

\b
Examples:
  ivl flight identify flights/july --fit rotor.tau_down,sense.latency,world.sensed_gap_offset --out my.yaml
      three numbers that decide whether a landing succeeds
  ivl flight identify flights/july --fit rotor.tau_down --hold-out 4 --out my.yaml
      every fourth flight is not fitted but judged
  ivl flight identify flights/july --fit body.inertia_yy,rotor.tau_down --sigma body.inertia_yy=4e-6 --out my.yaml
      a wider prior than the file's
  ivl learn experiments/paper_flight.yaml --set vehicle=my.yaml
      learn on the vehicle that flew
"""


@options.world_options
def identify(
    folder: options.Folder,
    chosen: Chosen,
    fit: Annotated[str, typer.Option(metavar="A.B,C.D", help="Parameters to fit, by dotted name.")],
    out: Annotated[Path, typer.Option(help="Vehicle file to write.")],
    sigma: Annotated[
        list[str] | None, typer.Option(metavar="A.B=C", help="Prior standard deviation in place of the file's.")
    ] = None,
    hold_out: Annotated[int, typer.Option(help="Hold out every N-th flight and judge it; 0: fit all.", min=0)] = 0,
    hold_out_moment: Annotated[
        str, typer.Option(metavar="LO:HI", help="Hold out the flights with a moment in this range, N mm.")
    ] = "",
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Identify; HELP is the text that people see."""
    _, library, store = options.flight_package()
    names = [name.strip() for name in fit.split(",") if name.strip()]
    if not names:
        raise ConfigError("--fit: names no parameter")
    if out.exists():
        raise ConfigError(f"--out {out}: exists already: name a new file")
    if out.suffix not in (".yaml", ".yml"):
        raise ConfigError(f"--out {out}: a vehicle file ends in .yaml")
    if hold_out == 1:
        raise ConfigError("--hold-out 1: would hold out every flight (allowed 0, or 2 and more)")
    options.check_parent("--out", out)
    low, high = _range(hold_out_moment)
    home, flights = chosen.make_world(), store.read(folder)
    sigmas = {text.partition("=")[0]: _number(text) for text in sigma or []}
    result = library.identify(
        flights, home, names, sigmas,
        lambda i, flip: (hold_out > 0 and i % hold_out == hold_out - 1) or low <= flip.moment_Nmm <= high,
        seed, None if as_json else console.say,
    )  # fmt: skip
    _write(out, library.vehicle_file(home.vehicle, result, _source(flights, result)))
    summary = result.summary()
    if as_json:
        console.print_json({**summary, "vehicle_file": str(out)})
        return
    _report(summary)
    console.say(f"vehicle file: {out}")


def _range(text: str) -> tuple[float, float]:
    """The range LO:HI; an empty one if nothing is given."""
    if not text:
        return 1.0, 0.0
    try:
        low, high = (float(word) for word in text.split(":"))
    except ValueError as error:
        raise ConfigError(f"--hold-out-moment {text}: expected LO:HI in N mm, for example 6.5:9") from error
    if not low <= high:
        raise ConfigError(f"--hold-out-moment {text}: LO must not be above HI")
    return low, high


def _number(text: str) -> float:
    name, _, value = text.partition("=")
    try:
        return float(value)
    except ValueError as error:
        raise ConfigError(f"--sigma {text}: expected NAME=NUMBER ({name or 'a parameter'} in its own unit)") from error


def _source(flights: Any, result: Any) -> str:
    names = ", ".join(str(item["file"]).rpartition("/")[2] for item in flights.manifest.source)
    return f"identified from the motion of {len(result.used)} recorded flights ({names}) by ivl flight identify"


def _write(path: Path, content: dict[str, Any]) -> None:
    try:
        files.write(path, yamlfile.dump(content, width=10_000, flow=None))
    except OSError as error:
        raise ConfigError(f"--out {path}: cannot be written: {files.reason(error)}") from error


def _report(summary: dict[str, Any]) -> None:
    table = Table(box=None, pad_edge=False)
    for name in ("parameter", "value", "95 % interval", "before", "unit"):
        table.add_column(name, justify="left" if name in ("parameter", "unit") else "right", no_wrap=True)
    for name, one in summary["parameters"].items():
        low, high = one["interval_95"]
        table.add_row(name, f"{one['value']:.5g}", f"{low:.4g} to {high:.4g}", f"{one['prior']:.5g}", one["unit"])
    console.out.print(table, soft_wrap=False)
    names = list(summary["parameters"])
    if len(names) > 1:
        console.out.print("correlation")
        for name, row in zip(names, summary["correlation"], strict=True):
            values = " ".join(f"{value:6.2f}" for value in row)
            console.out.print(f"  {name:28s} {values}")
    for label, part in (("fitted", "fitted"), ("held out", "held_out")):
        before, after = summary["before"][part], summary["after"][part]
        if before is not None:
            text = f"pitch {before['pitch_rms_deg']:.1f} deg before, {after['pitch_rms_deg']:.1f} deg after"
            console.out.print(f"{label} flights: {text}")
    error = 100.0 * summary["rotor_error"]
    text = f"rotor speeds at the trigger, fitted along: {error:+.2f} % (not part of the vehicle)"
    console.out.print(text)
    for text in summary["left_out"]:
        console.out.print(f"left out: {text}")
    for word in summary["words"]:
        console.out.print(word)
