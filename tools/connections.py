"""Connections with software vehicles: how long one takes, and whether many leave anything behind.

    python tools/connections.py time                     connect and read both tables with cflib, with and without cache
    python tools/connections.py cycles                   8 vehicles, each connected to 1,000 times, all at once
    python tools/connections.py cycles --vehicles 2 --cycles 100

A time is that from open_link to `connected`: both tables are there. A cycle connects, makes a log block, starts it,
deletes it and closes the socket. The exit code of `cycles` is 1 if a process has more files, or over 200 kB more
memory, than before.
"""

import argparse
import socket
import statistics
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import cflib.crtp
from cflib.crazyflie import Crazyflie

from ivl.silproc import SilProcess
from ivl.world import World

VEHICLE = "crazyflie21"
WARM_UP = 50
ANSWER_S, TRIES = 1.0, 30
KEPT_KB_MAX = 200
# who are you; make, start and delete a log block, by their first bytes and those of the answers
CYCLE = (("fd00", "f1"), ("5d0601010000", "5106"), ("5d08010100", "5108"), ("5d0401", "5104"))


def connect_s(uri: str, cache: str) -> float:
    """Seconds of one connection."""
    cf, done = Crazyflie(rw_cache=cache), threading.Event()
    cf.connected.add_callback(lambda _: done.set())
    began = time.perf_counter()
    cf.open_link(uri)
    if not done.wait(30.0):
        raise TimeoutError(f"{uri}: no connection in 30 s")
    took = time.perf_counter() - began
    cf.close_link()
    return took


def times(n: int) -> int:
    """Print medians and extremes of n connections of both kinds."""
    cflib.crtp.init_drivers()
    with SilProcess(World(VEHICLE)) as sil:
        with tempfile.TemporaryDirectory() as kept:
            connect_s(sil.uri, kept)
            cached = [connect_s(sil.uri, kept) for _ in range(n)]
        cold = []
        for _ in range(n):
            with tempfile.TemporaryDirectory() as empty:
                cold.append(connect_s(sil.uri, empty))
    for name, values in (("cold", cold), ("cached", cached)):
        print(f"{name}: median {statistics.median(values):.3f} s, {min(values):.3f} .. {max(values):.3f} s of {n}")
    return 0


@contextmanager
def client(uri: str) -> Iterator[socket.socket]:
    """A socket to a vehicle."""
    host, _, port = uri.removeprefix("udp://").partition(":")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.settimeout(ANSWER_S)
        made.connect((host, int(port)))
        yield made


def ask(to: socket.socket, packet: str, answer: str) -> None:
    """Send until it is answered; the bits 2 and 3 of a header mean nothing."""
    wanted = bytes.fromhex(answer)
    for _ in range(TRIES):
        to.send(bytes.fromhex(packet))
        try:
            while True:
                heard = to.recv(64)
                if heard and bytes([heard[0] & 0xF3]) + heard[1 : len(wanted)] == wanted:
                    return
        except TimeoutError:
            continue
    raise TimeoutError(f"{to.getpeername()}: no answer to {packet}")


def cycle(uri: str, n: int) -> None:
    """Connect n times."""
    for _ in range(n):
        with client(uri) as made:
            for packet, answer in CYCLE:
                ask(made, packet, answer)


def processes(pid: int) -> list[int]:
    """The program, and those that it has started: one a vehicle."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()
    return [pid, *(int(child) for child in children)]


def held(pid: int) -> tuple[int, int]:
    """Open files, and resident memory of its own in kB: the room that vehicles share fills as time passes."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    memory = next(line for line in status.splitlines() if line.startswith("RssAnon"))
    return len(list(Path(f"/proc/{pid}/fd").iterdir())), int(memory.split()[1])


def cycles(vehicles: int, n: int) -> int:
    """Connect to all at once, and compare what the processes hold before and afterwards."""
    with SilProcess(World(VEHICLE), vehicles=vehicles) as sil, ThreadPoolExecutor(vehicles) as pool:
        list(pool.map(lambda uri: cycle(uri, WARM_UP), sil.uris))
        before = [held(pid) for pid in processes(sil.pid)]
        list(pool.map(lambda uri: cycle(uri, n), sil.uris))
        after = [held(pid) for pid in processes(sil.pid)]
    files = max(b[0] - a[0] for a, b in zip(before, after, strict=True))
    memory_kB = max(b[1] - a[1] for a, b in zip(before, after, strict=True))
    print(f"{vehicles} vehicles, {n} connections each: at most {files:+d} files, {memory_kB:+d} kB")
    return 1 if files > 0 or memory_kB > KEPT_KB_MAX else 0


def main() -> int:
    """Do what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("time", "cycles"))
    parser.add_argument("--n", type=int, default=20, help="connections that are timed")
    parser.add_argument("--vehicles", type=int, default=8)
    parser.add_argument("--cycles", type=int, default=1000)
    said = parser.parse_args()
    return times(said.n) if said.what == "time" else cycles(said.vehicles, said.cycles)


if __name__ == "__main__":
    sys.exit(main())
