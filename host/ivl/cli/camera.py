"""`ivl camera`."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from ivl import files
from ivl.camera import bench, fit, rates, study
from ivl.cli import console
from ivl.cli.task_options import Chosen, task_options
from ivl.errors import ConfigError
from ivl.world import World

app = typer.Typer(no_args_is_help=True, help="The onboard camera: how well it sees a surface.")

TABLE_HELP = """Render approaches to several surfaces, estimate RREV and OF_y from them, and print how wrong they are.

Readings with a true RREV of 2 to 6 1/s at 60 pictures a second; speed 1.5 to 3.5 m/s, 30 to 90 degrees, with 10 mrad
of attitude error. Exit code 1 if a figure is beyond what it must show. docs/CAMERA.md explains each row.

\b
Examples:
  ivl camera table
  ivl camera table --approaches 400 --json
"""


@app.command("table", help=TABLE_HELP, short_help="Print how wrong the cues of rendered pictures are.")
def table(
    approaches: Annotated[int, typer.Option(help="Approaches of each row.", min=2)] = 60,
    seed: Annotated[int, typer.Option(help="Seed of approaches and noise.", min=0)] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> int:
    """Print the table; TABLE_HELP is the text that people see."""
    rows = study.table(approaches, seed)
    if as_json:
        console.print_json({"approaches": approaches, "seed": seed, "rows": [asdict(row) for row in rows]})
    else:
        console.out.print(_drawn(rows))
    return 1 if any(row.failed for row in rows) else 0


FIT_HELP = """Fly approaches with rendered pictures, and fit the noise model of a sensor set to their readings.

The speeds are 1.5 to 3.5 m/s, the angles 30 to 90 degrees. The file is a sensor set: `--sensing FILE.yaml` flies it.

\b
Examples:
  ivl camera fit --sensing aideck60 --texture panels
      the model's numbers
  ivl camera fit --sensing aideck60 --texture wall.png --out wall_model.yaml
      a sensor set for a surface of your own
"""


@app.command("fit", help=FIT_HELP, short_help="Fit a noise model to readings of rendered pictures.")
@task_options("vehicle", "gear", "gear_set", "sensing", "texture", "estimator", sensing="aideck60")
def fit_command(
    chosen: Chosen,
    approaches: Annotated[int, typer.Option(help="Approaches that are flown.", min=10)] = 60,
    seed: Annotated[int, typer.Option(help="Seed of approaches and noise.", min=0)] = 1,
    out: Annotated[Path | None, typer.Option(metavar="FILE.yaml", help="Write a sensor set with the model.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Fit; FIT_HELP is the text that people see."""
    if out is not None and out.suffix != ".yaml":
        raise ConfigError(f"--out {out}: a sensor set is a file .yaml")
    world = _looking(chosen)
    model = fit.of_world(world, approaches, seed)
    if out is not None:
        name = out.stem
        what = f"--sensing {world.sensing} --texture {world.texture}"
        source = f"ivl camera fit {what} --approaches {approaches} --seed {seed}"
        doc = f"Noise model of {world.sensing} over {world.texture}, fitted to rendered readings; no pictures."
        _write_set(out, fit.as_yaml(model, name, doc, source, world))
    if as_json:
        console.print_json({"readings": model.n, "numbers": model.numbers, "standard_errors": model.sigma})
        return
    console.out.print(f"{model.n} readings of {approaches} approaches")
    for name, value in model.numbers.items():
        spread = f" +- {model.sigma[name]:.2g}" if name in model.sigma else ""
        console.out.print(f"rrev.{name:14s} {value:.5g}{spread}")


LANDINGS_HELP = """How often pictures land, and how often their noise model does.

A threshold and a moment are chosen from a grid with the model alone; then both are flown with other random numbers.

\b
Examples:
  ivl camera landings --sensing aideck60 --texture panels --model aideck60_panels
"""


@app.command("landings", help=LANDINGS_HELP, short_help="Compare landing rates of pictures and of their noise model.")
@task_options("vehicle", "gear", "gear_set", "sensing", "texture", "estimator", "speed_mps", "angle_deg",
              sensing="aideck60", gear_set="as_simulated")  # fmt: skip
def landings(
    chosen: Chosen,
    model: Annotated[str, typer.Option(help="Sensor set with the noise model.")],
    rollouts: Annotated[int, typer.Option(help="Landings of each.", min=10)] = 400,
    seed: Annotated[int, typer.Option(help="Seed of the landings that are judged.", min=1)] = 2,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Compare; LANDINGS_HELP is the text that people see."""
    world = _looking(chosen)
    setup, gear = chosen.setup()
    modelled = setup.model_copy(update={"sensing": model, "texture": None}).world_of(gear)
    speed, angle = chosen.given.get("speed_mps", 2.5), chosen.given.get("angle_deg", 90.0)
    result = rates.compare(world, modelled, speed, angle, rollouts, seed)
    if as_json:
        console.print_json(asdict(result))
        return
    console.out.print(
        f"policy chosen with the model: RREV_c {result.rrev_c_per_s:.2f} 1/s, M_yd {result.moment_Nmm:g} N mm"
    )
    for what, rate in (("pictures", result.pictures), ("model", result.model)):
        spread = (rate * (1.0 - rate) / rollouts) ** 0.5
        console.out.print(f"{what:9s} {100 * rate:5.1f} % +- {100 * spread:.1f} land on four feet")


BENCH_HELP = """Let the estimator look at pictures that were taken, and print how wrong it is.

Each SEQUENCE is a file .npz, as `ivl rollout --frames` writes it, or a folder with frames.csv, camera.yaml and a
picture for each row. docs/CAMERA.md has the columns. Readings with a true RREV of 2 to 6 1/s count, or all if there
is none.

\b
Examples:
  ivl rollout --sensing aideck60 --texture panels --frames f.npz && ivl camera bench f.npz
      a film that was rendered
  ivl camera bench rail/monday rail/tuesday --out our_camera.yaml
      sequences of a rail, and a sensor set with the noise that was found
"""


@app.command("bench", help=BENCH_HELP, short_help="Print how wrong the cues of pictures are that were taken.")
def bench_command(
    sequences: Annotated[list[Path], typer.Argument(help="Files .npz or folders.", metavar="SEQUENCE...")],
    out: Annotated[Path | None, typer.Option(metavar="FILE.yaml", help="Write a sensor set with the noise.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Judge; BENCH_HELP is the text that people see."""
    if out is not None and out.suffix != ".yaml":
        raise ConfigError(f"--out {out}: a sensor set is a file .yaml")
    films = [bench.read(path) for path in sequences]
    rows = [bench.figures([film], path.name) for film, path in zip(films, sequences, strict=True)]
    if len(films) > 1:
        rows.append(bench.figures(films, "all"))
    if out is not None:
        found = bench.model(films)
        doc = f"Noise of a camera in {len(films)} sequences of pictures that were taken."
        _write_set(out, fit.as_yaml(found, out.stem, doc, "ivl camera bench", World(sensing="aideck60")))
    if as_json:
        console.print_json({"rows": [asdict(row) for row in rows]})
    else:
        console.out.print(_drawn(rows))


def _write_set(path: Path, text: str) -> None:
    """Write a sensor set.

    Raises:
        ConfigError: It cannot be written.
    """
    try:
        with files.replacing(path) as part:
            part.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"--out {path}: cannot be written: {files.reason(error)}") from error


def _looking(chosen: Chosen) -> World:
    """The world, which has a camera.

    Raises:
        ConfigError: It has none.
    """
    world = chosen.make_world()
    if not world.params.values["camera.rate"] > 0.0:
        raise ConfigError(f"--sensing {world.sensing}: there is no camera that takes pictures; aideck60 has one")
    return world


def _drawn(rows: list[study.Figures]) -> Table:
    drawn = Table(
        "surface", "valid", "bias", "sigma", "off > 25 %", "OF_y rad/s", "within 2 sigma", "ratio", "beyond", box=None
    )
    for row in rows:
        numbers = (
            (
                f"{100 * row.bias:+.2f} %",
                f"{100 * row.sigma:.2f} %",
                f"{100 * row.outliers:.2f} %",
                f"{row.of_y:.3f}",
                f"{100 * row.within:.1f} %",
            )
            if row.valid > 0.0
            else ("-",) * 5
        )
        ratio = f"{row.ratio:.2f}" if row.ratio else ""
        drawn.add_row(row.name, f"{100 * row.valid:.1f} %", *numbers, ratio, ", ".join(row.failed))
    return drawn
