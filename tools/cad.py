"""Make STL files of legs and jigs: the models in cad/, with the numbers of a gear file. What `make cad` does.

    python tools/cad.py --gear-set table1                  # every design of the set, into build/cad/table1
    python tools/cad.py --gear-set mine.yaml --gear wide   # one design of your own file
    python tools/cad.py --set modulus_MPa=2000             # another plastic

Files are named after design and part. OpenSCAD makes them; it also opens the models in cad/ by hand.
"""

import argparse
import subprocess
import sys
from pathlib import Path

from ivl import files, model
from ivl.errors import ConfigError, IvlError

ROOT = Path(__file__).parent.parent
MODELS = ROOT / "cad"
PARTS = {
    "leg": {
        "length_mm": ("leg.length", 1000.0),
        "angle_deg": ("leg.angle", 1.0),
        "stiffness_Nm_per_rad": ("leg.stiffness", 1.0),
        "mass_g": ("leg.mass", 1000.0),
        "foot_radius_mm": ("leg.foot_radius", 1000.0),
    },
    "jig": {
        "length_mm": ("leg.length", 1000.0),
        "angle_deg": ("leg.angle", 1.0),
        "hip_xy_mm": ("leg.hip_xy", 1000.0),
        "foot_radius_mm": ("leg.foot_radius", 1000.0),
    },
}
"""Numbers of each model: the parameter of the gear file, and what it is multiplied by."""


def make(part: str, values: dict[str, float], path: Path, extra: dict[str, str]) -> None:
    """Write the STL file of a part.

    Args:
        part: A key of `PARTS`.
        values: Parameters of the gear, in the units of the parameter table.
        path: The file.
        extra: Further variables of the model, as OpenSCAD reads them.

    Raises:
        ConfigError: OpenSCAD is missing, or refuses the model.
    """
    numbers = {name: repr(values[source] * factor) for name, (source, factor) in PARTS[part].items()} | extra
    words = [word for name, value in numbers.items() for word in ("-D", f"{name}={value}")]
    scad = MODELS / f"{part}.scad"
    with files.replacing(path) as written:
        try:
            done = subprocess.run(
                ["openscad", "--hardwarnings", "-o", str(written), *words, str(scad)],
                capture_output=True, text=True, check=False, timeout=600.0,
            )  # fmt: skip
        except FileNotFoundError as error:
            raise ConfigError("openscad is missing: `make cad` installs it") from error
        if done.returncode != 0:
            raise ConfigError(f"{scad.name} with {' '.join(words)}: {done.stderr.strip()}")


def main(arguments: list[str]) -> int:
    """Make what the arguments say; prints each file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--gear-set", default="table1", help="name or YAML file")
    parser.add_argument("--gear", help="one design; default: all of the set")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="variable of a model")
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "cad", help="folder")
    chosen = parser.parse_args(arguments)
    extra = dict(text.split("=", 1) for text in chosen.set)
    gears = [chosen.gear] if chosen.gear else model.list_gears(chosen.gear_set)
    folder = chosen.out / Path(chosen.gear_set).stem
    folder.mkdir(parents=True, exist_ok=True)
    for gear in gears:
        values = {name: found.value for name, found in model.load_gear(gear, chosen.gear_set).quantities.items()}
        for part in PARTS:
            path = folder / f"{gear}_{part}.stl"
            known = (MODELS / f"{part}.scad").read_text(encoding="utf-8")
            make(part, values, path, {name: value for name, value in extra.items() if f"\n{name} = " in known})
            print(path)
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except IvlError as error:
        sys.exit(f"cad: {error}")
