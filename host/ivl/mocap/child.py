"""The process that talks to the tracking system: request on stdin, frames on stdout.

Clients of tracking systems block without an end, spin, print, and crash; here they may. One line of JSON for an event:

{"ready": true}                                    connected
{"t_s": 12.5, "bodies": {"cf21": [x, y, z, qx, qy, qz, qw]}}   a frame, when it came (monotonic clock)
{"error": "..."}                                   the end

The process ends when stdin is closed, and when the first frame takes longer than it was told: by a signal whose default
action ends it, since a client that blocks holds Python's lock. It imports nothing of this package, to start fast.
"""

import json
import os
import resource
import signal
import sys
import threading
import time
from collections.abc import Mapping
from typing import Any

_MEMORY_BYTES = 1 << 30


def read_bodies(bodies: Mapping[str, Any]) -> dict[str, list[float]]:
    """Poses by name, as plain numbers."""
    return {
        name: [float(v) for v in body.position]
        + [float(body.rotation.x), float(body.rotation.y), float(body.rotation.z), float(body.rotation.w)]
        for name, body in bodies.items()
    }


def serve(request: Mapping[str, Any], emit: "Emit") -> None:
    """Connect and send frames for ever."""
    import motioncapture  # type: ignore[import-not-found,unused-ignore]

    signal.setitimer(signal.ITIMER_REAL, request["connect_s"])
    client = motioncapture.connect(request["system"], request["options"])
    emit({"ready": True})
    client.waitForNextFrame()
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    while True:
        emit({"t_s": time.monotonic(), "bodies": read_bodies(client.rigidBodies)})
        client.waitForNextFrame()


class Emit:
    """Writes events where the parent reads them."""

    def __init__(self, fd: int) -> None:
        """Write to a file descriptor."""
        self._fd = fd

    def __call__(self, event: Mapping[str, Any]) -> None:
        """Write one event."""
        data = json.dumps(event).encode() + b"\n"
        while data:
            data = data[os.write(self._fd, data) :]


def main() -> None:
    """Run until the parent is gone."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_DATA, (_MEMORY_BYTES, _MEMORY_BYTES))  # a hostile count of bodies ends it early
    request = json.loads(sys.stdin.readline())
    # clients print on stdout: what they print goes to stderr, and frames to a copy that only we know
    emit = Emit(os.dup(1))
    os.dup2(2, 1)
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's business
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        serve(request, emit)
    except BrokenPipeError:
        pass
    except Exception as error:
        emit({"error": str(error) or type(error).__name__})
        raise


def _end_with_parent() -> None:
    sys.stdin.read()
    os._exit(0)


if __name__ == "__main__":
    main()
