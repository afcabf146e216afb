"""Count what programs of the Crazyflie world do with the software vehicle: each with vehicles that were just started.

    python tools/clients.py examples crazyflie-lib-python/examples [WORD ...]
    python tools/clients.py rig crazyflie-lib-python             (sys_test/swarm_test_rig, ten vehicles)
    python tools/clients.py grounded crazyflie-lib-python        (sys_test/single_cf_grounded)
    python tools/clients.py qa crazyflie-testing                 (tests/QA; wants toml and pytest-timeout)
    python tools/clients.py cfclient                             (the client as installed; wants make qt-libraries)

The folders are checkouts of bitcraze/crazyflie-lib-python and bitcraze/crazyflie-testing. Programs run from copies in a
temporary folder, in which the addresses of radios are those of the vehicles, and nothing else is changed. One line per
program: exit code, seconds; then for each vehicle the ranges and the end of its true motion and how far it turned: an
exit code of 0 alone is no success. WORD selects the programs whose path has it.
"""

import argparse
import contextlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

from ivl.errors import LinkError
from ivl.silproc import SilProcess
from ivl.world import World

VEHICLE = "crazyflie21"
TOUR = Path(__file__).parent.parent / "tests" / "sil" / "cfclient_tour.py"
RADIO = re.compile(r"""(?P<quote>['"])(?:radio|usb)://[^'"]*(?P=quote)""")
WATCHED = ("simTruth.x", "simTruth.y", "simTruth.z", "stateEstimate.yaw")
PERIOD_S = 0.1
SITE = 'version = 1\n[device.sil]\nradio = "{uri}"\ndecks = [{decks}]\n'


class Watched:
    """Vehicles whose true motion is written down while they fly."""

    def __init__(self, n: int, decks: list[str]) -> None:
        """Say how many, and with which decks."""
        self.sil = SilProcess(World(VEHICLE), vehicles=n, decks=decks)
        self._rows: list[list[list[float]]] = [[] for _ in range(n)]
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> "Watched":
        """Start."""
        self.sil.start()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop."""
        self._stop.set()
        self._thread.join()
        self.sil.stop()

    def _watch(self) -> None:
        while not self._stop.wait(PERIOD_S):
            for vehicle, rows in enumerate(self._rows):
                with contextlib.suppress(LinkError):  # an answer that is late on a busy machine is missed
                    rows.append([self.sil.get(name, vehicle) for name in WATCHED])

    def lines(self) -> Iterator[str]:
        """What each vehicle did."""
        for rows in self._rows:
            if not rows:
                yield "no motion seen"
                continue
            columns = list(zip(*rows, strict=True))
            ranges = " ".join(f"{axis} {min(c):.2f}..{max(c):.2f}" for axis, c in zip("xyz", columns[:3], strict=True))
            turned = sum((b - a + 180.0) % 360.0 - 180.0 for a, b in zip(columns[3], columns[3][1:], strict=False))
            end = ", ".join(f"{c[-1]:.2f}" for c in columns[:3])
            yield f"{ranges} end ({end}) m, turned {turned:.0f} deg"


def addressed(text: str, uris: list[str]) -> str:
    """A program's text with the vehicles' addresses in the place of radios, in the order in which they come."""
    seen: dict[str, str] = {}

    def uri(match: re.Match[str]) -> str:
        seen.setdefault(match[0], uris[len(seen) % len(uris)])
        return repr(seen[match[0]])

    return RADIO.sub(uri, text)


def radios(text: str) -> int:
    """How many vehicles a program names; one that takes its address from the environment names one."""
    return 1 if "uri_from_env" in text else max(1, len({match[0] for match in RADIO.finditer(text)}))


def run(command: list[str], folder: Path, flight: Watched, seconds: float, **more: str) -> tuple[str, float, str]:
    """Exit code, seconds and the last line of what was said.  Those who ask for a key get one."""
    screen = {"MPLBACKEND": "Agg", "QT_QPA_PLATFORM": "offscreen"}  # whoever draws does so where nobody looks
    environment = {**os.environ, "CFLIB_URI": flight.sil.uri, **screen, **more}
    began = time.monotonic()
    try:
        done = subprocess.run(
            command, cwd=folder, env=environment, input="\n" * 9, capture_output=True, text=True,
            timeout=seconds, check=False, errors="replace",
        )  # fmt: skip
        code, said = str(done.returncode), done.stdout + done.stderr
    except subprocess.TimeoutExpired:
        code, said = "stopped", ""
    words = said.strip().splitlines()
    return code, time.monotonic() - began, words[-1][:120] if words else ""


def report(name: str, result: tuple[str, float, str], flight: Watched) -> bool:
    """Print what came of a program.  Returns: whether its exit code was 0."""
    code, seconds, words = result
    print(f"{code:>7} {seconds:4.0f} s  {name}  {'' if code == '0' else words}", flush=True)
    for line in flight.lines():
        print(f"                {line}", flush=True)
    return code == "0"


def examples(folder: Path, chosen: list[str], decks: list[str], seconds: float) -> list[bool]:
    """Each program of a folder."""
    results = []
    for path in sorted(folder.rglob("*.py")):
        name = str(path.relative_to(folder))
        if chosen and not any(word in name for word in chosen):
            continue
        text = path.read_text(encoding="utf-8")
        with tempfile.TemporaryDirectory() as copies, Watched(radios(text), decks) as flight:
            here = Path(copies) / "programs"
            shutil.copytree(path.parent, here)  # with the modules and pictures that lie beside it
            (here / path.name).write_text(addressed(text, flight.sil.uris), encoding="utf-8")
            command, stored = [sys.executable, path.name], here / "stored.yaml"
            if "--file" in text:  # it wants a file of stored parameters
                state = "{default_value: 6, is_stored: true, stored_value: 10}"
                stored.write_text(f"params:\n  ring.effect: {state}\ntype: persistent_param_state\nversion: '1'\n")
                command += ["--file", str(stored)]
            results.append(report(name, run(command, here, flight, seconds), flight))
    return results


def unit_tests(folder: Path, chosen: list[str], decks: list[str], n: int, pattern: str) -> list[bool]:
    """Each method of the unit tests that match a pattern."""
    results = []
    for path in sorted(folder.glob(pattern)):
        text = path.read_text(encoding="utf-8")
        for name in re.findall(r"^    def (test_\w+)", text, re.MULTILINE):
            if chosen and not any(word in name for word in chosen):
                continue
            with tempfile.TemporaryDirectory() as copies, Watched(n, decks) as flight:
                copy = Path(copies) / "copy"
                shutil.copytree(folder, copy, ignore=shutil.ignore_patterns(".git"))
                here = copy / path.parent.relative_to(folder)
                for other in here.glob("*.py"):
                    other.write_text(addressed(other.read_text(encoding="utf-8"), flight.sil.uris), encoding="utf-8")
                kind = re.findall(r"class (\w+)\(", text)[0]
                module = ".".join(path.relative_to(folder).with_suffix("").parts)
                where, module = (copy, module) if n > 1 else (here, path.stem)
                command = [sys.executable, "-m", "unittest", f"{module}.{kind}.{name}"]
                results.append(report(name, run(command, where, flight, 600.0, PYTHONPATH=str(where)), flight))
    return results


def cfclient(picture: Path) -> list[bool]:
    """Everything in Bitcraze's client that this vehicle has, clicked once; the window in flight goes into a picture."""
    host = f"127.78.{os.getpid() >> 8 & 255}.{os.getpid() & 255}"  # where nobody else scans
    with tempfile.TemporaryDirectory() as home, SilProcess(World(VEHICLE), port=19850, bind=host) as sil:
        sil.set("sil.auto_arm", 0)
        sil.set("sil.place", 1)
        sil.set("supervisor.prefltTimeout", 60000)  # a busy machine clicks slowly
        settings = {"HOME": home, "XDG_CONFIG_HOME": home, "QT_QPA_PLATFORM": "offscreen", "SCAN_ADDRESS": host}
        command = [sys.executable, str(TOUR), sil.uri, str(picture)]
        subprocess.run(command, env={**os.environ, **settings}, stderr=subprocess.DEVNULL, timeout=1800.0, check=False)
    seen = json.loads(picture.with_suffix(".json").read_text(encoding="utf-8"))
    print(f"{len(seen['plotted'])} log configurations drew", flush=True)
    return [thing["ok"] for thing in seen["things"]]


def qa(folder: Path, chosen: list[str], decks: list[str]) -> list[bool]:
    """Bitcraze's own tests of a vehicle, at a site that has the software vehicle and its decks."""
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    results = []
    with tempfile.TemporaryDirectory() as copies:
        copy = Path(copies) / "copy"
        shutil.copytree(folder, copy, ignore=shutil.ignore_patterns(".git"))
        site = copy / "sites" / "sil.toml"
        names = ", ".join(f'"{deck}"' for deck in decks if deck != "none")
        site.write_text(SITE.format(uri="udp://127.0.0.1:1", decks=names), encoding="utf-8")
        environment = {**os.environ, "CRAZY_SITE": "sil"}
        listed = subprocess.run(
            [*command, "--collect-only", "tests/QA"],
            cwd=copy,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        ).stdout
        for name in (line for line in listed.splitlines() if "::" in line):
            if chosen and not any(word in name for word in chosen):
                continue
            with Watched(1, decks) as flight:
                site.write_text(SITE.format(uri=flight.sil.uri, decks=names), encoding="utf-8")
                results.append(report(name, run([*command, name], copy, flight, 600.0, CRAZY_SITE="sil"), flight))
    return results


def main() -> int:
    """Run what was asked for, and count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("examples", "rig", "grounded", "qa", "cfclient"))
    parser.add_argument("folder", type=Path, nargs="?", default=Path(), help="the checkout; not for cfclient")
    parser.add_argument("word", nargs="*", help="run only what has one of these words in its path")
    parser.add_argument("--deck", action="append", default=[], help="as for ivl sil")
    parser.add_argument("--seconds", type=float, default=120.0, help="after which an example is stopped")
    said = parser.parse_args()
    if not said.folder.is_dir():
        parser.error(f"{said.folder}: is no folder")
    if said.what == "cfclient":
        with tempfile.TemporaryDirectory() as pictures:
            results = cfclient(Path(pictures) / "cfclient.png")
    elif said.what == "examples":
        results = examples(said.folder, said.word, said.deck, said.seconds)
    elif said.what == "rig":
        results = unit_tests(said.folder, said.word, said.deck, 10, "sys_test/swarm_test_rig/test_*.py")
    elif said.what == "grounded":
        results = unit_tests(said.folder, said.word, said.deck, 1, "sys_test/single_cf_grounded/test_*.py")
    else:
        results = qa(said.folder, said.word, said.deck or ["none"])
    print(f"{sum(results)} of {len(results)} {'things' if said.what == 'cfclient' else 'with exit code 0'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
