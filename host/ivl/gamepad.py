"""Gamepads as the kernel has them (`/dev/input/js*`): whether a button was pressed. On other systems there is none.

An event has eight bytes: time (ms), value, kind, number. What the kernel tells of the state when a device is opened is
of another kind, and is no press.
"""

import errno
import os
import struct
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

FOLDER, NAMES = Path("/dev/input"), "js*"
_EVENT = struct.Struct("<IhBB")
_BUTTON = 0x01
_EVENTS_MAX = 64


def found() -> list[Path]:
    """Devices that can be read now."""
    return [path for path in sorted(FOLDER.glob(NAMES)) if os.access(path, os.R_OK)]


@contextmanager
def buttons(say: Callable[[str], None]) -> Iterator[Callable[[], bool]]:
    """Whether a button of any gamepad was pressed since it was asked last; `say` is told of one that is gone."""
    with ExitStack() as held:
        pads: dict[Path, int] = {}
        for path in found():
            pads[path] = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
            held.callback(os.close, pads[path])

        def pressed() -> bool:
            heard = [_is_pressed(path, pads, say) for path in list(pads)]  # each is read
            return any(heard)

        yield pressed


def _is_pressed(path: Path, pads: dict[Path, int], say: Callable[[str], None]) -> bool:
    try:
        data = os.read(pads[path], _EVENT.size * _EVENTS_MAX)
    except OSError as error:
        if error.errno not in (errno.EAGAIN, errno.EINTR):
            del pads[path]
            say(f"gamepad {path} is gone: it does not stop the vehicle any more ({error.strerror})")
        return False
    whole = data[: len(data) - len(data) % _EVENT.size]
    return any(kind == _BUTTON and value == 1 for _, value, kind, _ in _EVENT.iter_unpack(whole))
