"""Stop: any key in the terminal, a button of a gamepad, or `ivl stop` in another terminal, while a vehicle flies.

A thread of its own looks every 5 ms, and sends what stops the vehicle every 5 ms until the flight is over or a tenth of
a second has passed. Then the thread that flies goes on with it, as with any command. The site says what a stop does:

level_out    before the trigger an abort; under the stock controller a landing. A flip is completed.
motors_off   an emergency stop: motors off at once, whatever the vehicle does; it is locked until it is switched off.

A request from another terminal is a file in the run folder that belongs to the user who flies; nobody else is obeyed.
"""

import os
import select
import stat
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Protocol

from ivl import gamepad
from ivl.errors import LinkError, StoreError

FILE, FLYING = "stop", "flying"
POLL_S = 0.005
REPEATS = 20
_ANSWER_S = 2.0

Pressed = Callable[[], bool]


class Stoppable(Protocol):
    """What is needed of `ivl.links.vehicle.Vehicle`."""

    def stop(self, reason: str, motors_off: bool) -> None:
        """From now on nothing is flown any more; to be followed by `send_stop`. From any thread."""
        ...

    def send_stop(self) -> None:
        """Send once what stops the vehicle. From any thread."""
        ...


class Stop:
    """Watches over one flight after the other."""

    def __init__(self, folder: Path | None, motors_off: bool, say: Callable[[str], None]) -> None:
        """Watch nothing yet.

        Args:
            folder: Run folder in which `ivl stop` asks; None: nobody can.
            motors_off: What stops.
            say: Told that it was stopped.
        """
        self._folder, self._motors_off, self._say = folder, motors_off, say
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None

    def begin(self, vehicle: Stoppable) -> None:
        """A flight begins: from now on keys belong to the stop."""
        self.end()
        self._ended.clear()
        self._thread = threading.Thread(target=self._run, args=(vehicle,), name="ivl-stop", daemon=True)
        if self._folder is not None and self._folder.is_dir():
            (self._folder / FLYING).write_text(f"{os.getpid()}\n", encoding="ascii")
        self._thread.start()

    def end(self) -> None:
        """The flight is over: keys belong to the questions again; again does nothing."""
        thread, self._thread = self._thread, None
        if thread is None:
            return
        self._ended.set()
        thread.join()
        if self._folder is not None:
            for name in (FLYING, FILE):
                (self._folder / name).unlink(missing_ok=True)

    def _run(self, vehicle: Stoppable) -> None:
        with keys() as key, gamepad.buttons(self._say) as button:
            asked: dict[str, Pressed] = {"a key": key, "a gamepad": button, "ivl stop": partial(is_asked, self._folder)}
            while not self._ended.wait(POLL_S):
                who = next((name for name, is_so in asked.items() if is_so()), "")
                if who:
                    self._obey(vehicle, who)
                    return

    def _obey(self, vehicle: Stoppable, who: str) -> None:
        what = "motors off" if self._motors_off else "level-out and landing"
        try:
            act(vehicle, f"stopped by {who}", self._motors_off, self._ended.wait)
        except LinkError as error:  # the vehicle ends its flight by its own rules
            what = f"not sent: {error}"
        if self._folder is not None:
            (self._folder / FILE).unlink(missing_ok=True)
        self._say(f"STOP: by {who}: {what}")


def act(vehicle: Stoppable, reason: str, motors_off: bool, pause: Callable[[float], object]) -> None:
    """Stop a vehicle: the first packet at once, and then again, since each may be lost; `pause` true ends it early."""
    vehicle.stop(reason, motors_off)
    for _ in range(REPEATS):
        vehicle.send_stop()
        if pause(POLL_S):
            return


@contextmanager
def keys() -> Iterator[Pressed]:
    """Whether a key was pressed since it was asked last; never, where standard input is no terminal."""
    if not sys.stdin.isatty():
        yield lambda: False
        return
    import termios  # the package loads where there is none
    import tty

    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)
    tty.setcbreak(descriptor)
    try:  # a key that was pressed in the countdown counts
        yield lambda: bool(select.select([descriptor], [], [], 0.0)[0] and os.read(descriptor, 64))
    finally:
        termios.tcsetattr(descriptor, termios.TCSANOW, before)


def is_asked(folder: Path | None) -> bool:
    """Whether the user who flies has asked for a stop in a run folder."""
    if folder is None:
        return False
    try:
        found = os.lstat(folder / FILE)
    except OSError:
        return False
    return stat.S_ISREG(found.st_mode) and found.st_uid == os.getuid()


def ask(folder: Path) -> bool:
    """Ask the program that flies in a run folder to stop; returns whether it answered within two seconds.

    Raises:
        StoreError: Nothing flies there, or the folder is somebody else's.
    """
    if not (folder / FLYING).is_file():
        raise StoreError(f"{folder}: no vehicle flies in this run now")
    path = folder / FILE
    try:
        with suppress(FileExistsError):
            os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600))
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror}") from error
    end_s = time.monotonic() + _ANSWER_S
    while path.exists() and time.monotonic() < end_s:
        time.sleep(POLL_S)
    answered = not path.exists()
    path.unlink(missing_ok=True)
    return answered


def flying(runs: Path) -> list[Path]:
    """Run folders in a folder in which a vehicle flies now."""
    return sorted(path.parent for path in runs.glob(f"*/{FLYING}"))
