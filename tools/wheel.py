"""Build wheels of the package: everything in it, compiled, for machines without a compiler.

    .venv/bin/python tools/wheel.py                        # for this machine's processor
    .venv/bin/python tools/wheel.py --machine aarch64      # cross-compiled; needs gcc-aarch64-linux-gnu

A wheel has the package's tracked files and, compiled anew, the native library and the software vehicle. Its name says
for which processor it is, and the oldest glibc that has every symbol which these two need.
"""

import argparse
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from elftools.elf.elffile import ELFFile
from elftools.elf.gnuversions import GNUVerNeedSection

ROOT = Path(__file__).parent.parent
OUT = ROOT / "build" / "wheels"
FLAVOURS = {"x86_64": "release", "aarch64": "aarch64"}
BINARIES = ("libivl_sil.so", "ivl_sil")


def compiled(machine: str) -> list[Path]:
    """The native library and the software vehicle, made by the project's own makefile."""
    flavour = FLAVOURS[machine]
    jobs = os.environ.get("JOBS", "1")
    command = ["make", "--no-print-directory", f"-j{jobs}", "-f", "tools/native.mk", f"FLAVOUR={flavour}", "lib", "sil"]
    subprocess.run(command, cwd=ROOT, check=True)
    return [ROOT / "build" / flavour / name for name in BINARIES]


def glibc_needed(binaries: list[Path]) -> tuple[int, int]:
    """The oldest glibc that has every symbol of some programs."""
    found = []
    for path in binaries:
        with path.open("rb") as file:
            for section in ELFFile(file).iter_sections():
                if not isinstance(section, GNUVerNeedSection):
                    continue
                for _, versions in section.iter_versions():
                    names = [version.name for version in versions if version.name.startswith("GLIBC_")]
                    found += [tuple(map(int, name.removeprefix("GLIBC_").split(".")[:2])) for name in names]
    return max(found)


def tracked() -> list[Path]:
    """Files of the package that are in the repository; without a repository all that are no product of a build."""
    done = subprocess.run(["git", "ls-files", "host"], cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode == 0:
        return [Path(line) for line in done.stdout.splitlines()]
    files = (path.relative_to(ROOT) for path in (ROOT / "host" / "ivl").rglob("*") if path.is_file())
    return [path for path in files if "_native" not in path.parts and "__pycache__" not in path.parts]


def build(machine: str) -> Path:
    """Build one wheel into build/wheels, and return its path."""
    binaries = compiled(machine)
    major, minor = glibc_needed(binaries)
    OUT.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="ivl-wheel-") as name:
        stage = Path(name)
        for path in [*tracked(), Path("pyproject.toml"), Path("LICENSE"), Path("README.md")]:
            (stage / path).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / path, stage / path)
        native = stage / "host" / "ivl" / "_native"
        native.mkdir(exist_ok=True)
        for path in binaries:
            shutil.copy(path, native)
        # the library is found by its name, whatever the version of Python
        (stage / "setup.cfg").write_text(f"[bdist_wheel]\nplat_name = manylinux_{major}_{minor}_{machine}\n")
        pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "wheel", "--quiet", "--no-deps"]
        subprocess.run([*pip, "--wheel-dir", str(stage / "made"), str(stage)], check=True)
        (made,) = (stage / "made").glob("*.whl")
        for old in OUT.glob(f"*_{machine}.whl"):
            old.unlink()
        return Path(shutil.move(made, OUT / made.name))


def main() -> None:
    """Build what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--machine", choices=FLAVOURS, default=platform.machine(), help="processor; default: this one")
    made = build(parser.parse_args().machine)
    print(f"{made.relative_to(ROOT)}: {made.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
