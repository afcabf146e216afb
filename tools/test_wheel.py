"""Try the wheels of build/wheels as users have them: a fresh environment, no compiler, no repository.

    .venv/bin/python tools/test_wheel.py                          # of this processor, with this Python
    .venv/bin/python tools/test_wheel.py --python python3.13      # with another one
    .venv/bin/python tools/test_wheel.py --lowest                 # with the oldest packages that it says it works with
    .venv/bin/python tools/test_wheel.py --machine aarch64        # its programs, under qemu-user: the same bits

The programs of the environment see a PATH without anything but the environment itself, and run in an empty folder.
"""

import argparse
import os
import platform
import re
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).parent.parent
WHEELS = ROOT / "build" / "wheels"
N_LANDINGS = 64
TRIPLET = "aarch64-linux-gnu"

LEARN = "learn paper_vertical --learner ephe --set n_rollouts=4 --set budget=8 --set check.n_fresh=5"
COMMANDS = (
    "--version",
    "list",
    "rollout --gear wide_short --speed 2.5 --angle 60 --rrev 5 --moment 8 --plot landing.png --json",
    f"{LEARN} --set check.effort=0.02 --out run --json",
    "sil --help",
)
PROGRAM = """
import sys
import numpy as np
import ivl
from ivl.silproc import SilProcess
world = ivl.World("habas2021", "wide_long", "as_simulated")
out = world.rollouts(2.5, 90.0, np.linspace(3.0, 6.0, 64), 8.0)
assert ivl.four_leg(out).any() and not ivl.four_leg(out).all(), out
assert "compiler" not in sys.modules
run = ivl.load("run")
assert run.result["rollouts"] == 8 and run.recommended()
try:
    out.to_pandas()
except ivl.MissingError as error:
    assert "ivl[frames]" in str(error)
else:
    raise SystemExit("pandas is installed, though nobody asked for it")
print(out, "from", ivl.__file__)
"""


def wheel_of(machine: str) -> Path:
    """The wheel for a processor."""
    found = sorted(WHEELS.glob(f"*_{machine}.whl"))
    if len(found) != 1:
        sys.exit(f"test_wheel: {WHEELS}: {len(found)} wheels for {machine}: run make wheel")
    return found[0]


def lowest_versions() -> list[str]:
    """The oldest versions that pyproject.toml allows of what the package needs to run."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return [re.sub(r">=([\w.]+).*", r"==\1", requirement) for requirement in project["dependencies"]]


def test_installed(wheel: Path, python: str, lowest: bool) -> None:
    """Install a wheel into a fresh environment, and use it."""
    with tempfile.TemporaryDirectory(prefix="ivl-test-wheel-") as name:
        folder = Path(name)
        subprocess.run([python, "-m", "venv", str(folder / "venv")], check=True)
        own = folder / "venv" / "bin"
        pip = [str(own / "python"), "-m", "pip", "--disable-pip-version-check", "install", "--quiet"]
        subprocess.run([*pip, "--only-binary", ":all:", str(wheel), *(lowest_versions() if lowest else [])], check=True)
        empty = folder / "elsewhere"
        empty.mkdir()
        clean = {"PATH": str(own), "HOME": str(folder), "MPLBACKEND": "agg", "XDG_CACHE_HOME": str(folder / "cache")}
        for command in COMMANDS:
            print(f"    ivl {command}", flush=True)
            subprocess.run(
                [str(own / "ivl"), *command.split()], cwd=empty, env=clean, check=True, stdout=subprocess.DEVNULL
            )
        if not (empty / "landing.png").stat().st_size:
            sys.exit("test_wheel: landing.png is empty")
        subprocess.run([str(own / "python"), "-c", PROGRAM], cwd=empty, env=clean, check=True)
        server = subprocess.run([str(own / "python"), "-c", "import ivl.silproc as s; print(s.__file__)"], cwd=empty,
                                env=clean, check=True, capture_output=True, text=True).stdout  # fmt: skip
        program = Path(server.strip()).parent / "_native" / "ivl_sil"
        done = subprocess.run([str(program), "--help"], env=clean, capture_output=True, text=True, check=False)
        if "usage" not in (done.stdout + done.stderr).lower():
            sys.exit(f"test_wheel: {program} does not start: {done.stderr}")


def test_emulated(wheel: Path) -> None:
    """Fly landings with the library of a wheel for another processor, and compare their bits with this machine's."""
    import numpy as np

    import ivl
    from ivl import native

    world = ivl.World("crazyflie21", "wide_short", "table1", "camera50")
    rng = np.random.default_rng(1)
    specs = native.library().default_specs(N_LANDINGS)
    specs["speed_mps"], specs["angle_deg"] = rng.uniform(1, 4, N_LANDINGS), rng.uniform(30, 90, N_LANDINGS)
    specs["theta"][:, 0], specs["theta"][:, 1] = rng.uniform(2, 8, N_LANDINGS), rng.uniform(0.004, 0.009, N_LANDINGS)
    specs["seed"], specs["start"] = rng.integers(2**62, size=N_LANDINGS), rng.integers(2, size=N_LANDINGS)
    expected = world.native_model.rollouts(specs, 1)
    with tempfile.TemporaryDirectory(prefix="ivl-test-wheel-") as name:
        folder = Path(name)
        with zipfile.ZipFile(wheel) as archive:
            archive.extractall(folder)
        native_folder = folder / "ivl" / "_native"
        world.params.vector().tofile(folder / "params")
        specs.tofile(folder / "specs")
        probe = folder / "probe"
        compiler = [f"{TRIPLET}-gcc", "-std=c11", "-Wall", "-Wextra", "-Werror", f"-I{ROOT / 'sim_sil'}"]
        source = [str(ROOT / "tools" / "wheel_probe.c"), str(native_folder / "libivl_sil.so")]
        subprocess.run([*compiler, "-o", str(probe), *source, f"-Wl,-rpath,{native_folder}"], check=True)
        emulator = ["qemu-aarch64", "-L", f"/usr/{TRIPLET}"]
        files = [str(folder / name) for name in ("params", "specs")]
        outcomes = folder / "outcomes"
        subprocess.run([*emulator, str(probe), *files, str(N_LANDINGS), str(outcomes)], check=True)
        found = np.fromfile(outcomes, dtype=expected.dtype)
        if found.tobytes() != expected.tobytes():
            n = sum(a.tobytes() != b.tobytes() for a, b in zip(found, expected, strict=True))
            sys.exit(f"test_wheel: {n} of {N_LANDINGS} landings have other bits on aarch64")
        program = native_folder / "ivl_sil"
        program.chmod(0o755)  # pip keeps the mode of a file, zipfile does not
        server = subprocess.run([*emulator, str(program), "--help"], capture_output=True, text=True, check=False)
        if "usage" not in (server.stdout + server.stderr).lower():
            sys.exit(f"test_wheel: ivl_sil does not start: {server.stderr}")
    print(
        f"    {N_LANDINGS} landings, {int(ivl.four_leg(found).sum())} landed: the same bits as on {platform.machine()}"
    )


def main() -> None:
    """Try what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--machine", choices=("x86_64", "aarch64"), default=platform.machine())
    parser.add_argument("--python", default=sys.executable, help="program; default: this one")
    parser.add_argument("--lowest", action="store_true", help="with the oldest packages that are allowed")
    args = parser.parse_args()
    os.chdir(ROOT)
    wheel = wheel_of(args.machine)
    print(f"==> {wheel.name}", flush=True)
    if args.machine != platform.machine():
        test_emulated(wheel)
    else:
        test_installed(wheel, args.python, args.lowest)


if __name__ == "__main__":
    main()
