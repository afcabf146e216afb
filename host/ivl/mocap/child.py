"""The process that talks to the tracking system: request on stdin, frames on stdout.

Clients of tracking systems block without an end, spin, print, and crash; here they may. One line of JSON for an event:

{"ready": true}                                    connected
{"t_s": 12.5, "bodies": {"cf21": [x, y, z, qx, qy, qz, qw]}}   a frame, when it came (monotonic clock)
{"error": "..."}                                   the end

The process ends when stdin is closed, and when the first frame takes longer than it was told: by a signal whose default
action ends it, since a client that blocks holds Python's lock. It imports nothing of this package, to start fast.

OptiTrack's frames are datagrams without a sender's name in them, and its client takes whatever comes. Here the system
drops what does not come from the server's address and, from the first frame on, from the same socket there.
"""

import ctypes
import json
import os
import resource
import select
import signal
import socket
import struct
import sys
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

_MEMORY_BYTES = 1 << 30
_SO_ATTACH_FILTER = 26  # of Linux, which Python's socket module does not name
_LOAD_WORD, _LOAD_HALF, _JUMP_IF_EQUAL, _RETURN = 0x20, 0x28, 0x15, 0x06
_SOURCE_ADDRESS = 0xFFF00000 + 12  # in the header of the network layer
_SOURCE_PORT = 0  # in the datagram's own header
_WHOLE = 0xFFFF


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
    if request["system"] == "optitrack":
        trust_only(request["options"]["hostname"])
    emit({"ready": True})
    client.waitForNextFrame()
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    while True:
        emit({"t_s": time.monotonic(), "bodies": read_bodies(client.rigidBodies)})
        client.waitForNextFrame()


def trust_only(host: str) -> None:
    """Wait for the first datagram from an address; from then on only its sender is heard on that socket."""
    address = struct.unpack("!I", socket.inet_aton(host))[0]
    sockets = _datagram_sockets()
    for one in sockets:
        _hear_only(one, address, None)
        _drain(one)
    for one in select.select(sockets, [], [])[0]:
        _, sender = one.recvfrom(1, socket.MSG_PEEK)
        _hear_only(one, address, sender[1])
        _drain(one)
    for one in sockets:
        one.close()


def _datagram_sockets() -> list[socket.socket]:
    """Second handles of this process's UDP sockets, which its client has opened."""
    found = []
    for handle in Path("/proc/self/fd").iterdir():
        try:
            one = socket.socket(fileno=os.dup(int(handle.name)))
        except OSError:  # no socket, or the handle of the folder itself
            continue
        if one.type == socket.SOCK_DGRAM and one.family == socket.AF_INET:
            found.append(one)
        else:
            one.close()
    return found


def _hear_only(one: socket.socket, address: int, port: int | None) -> None:
    """Let the system drop what is from another address, or another port; what has come already stays."""
    steps = [(_LOAD_WORD, 0, 0, _SOURCE_ADDRESS), (_JUMP_IF_EQUAL, 0, 1 if port is None else 3, address)]
    if port is not None:
        steps += [(_LOAD_HALF, 0, 0, _SOURCE_PORT), (_JUMP_IF_EQUAL, 0, 1, port)]
    steps += [(_RETURN, 0, 0, _WHOLE), (_RETURN, 0, 0, 0)]
    code = ctypes.create_string_buffer(b"".join(struct.pack("HBBI", *step) for step in steps))
    one.setsockopt(socket.SOL_SOCKET, _SO_ATTACH_FILTER, struct.pack("HL", len(steps), ctypes.addressof(code)))


def _drain(one: socket.socket) -> None:
    """Forget what came before the filter."""
    try:
        while True:
            one.recv(1, socket.MSG_DONTWAIT)
    except BlockingIOError:
        pass


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
