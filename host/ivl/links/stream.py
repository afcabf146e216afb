"""How fast a software vehicle runs freely with unmodified cflib attached and logging."""

import threading
import time

import cflib.crtp  # type: ignore[import-untyped]
from cflib.crazyflie import Crazyflie  # type: ignore[import-untyped]
from cflib.crazyflie.log import LogConfig  # type: ignore[import-untyped]

from ivl.errors import LinkError
from ivl.silproc import SilProcess
from ivl.world import World

_NAMES = ("stateEstimate.x", "stateEstimate.y", "stateEstimate.z", "stateEstimate.vz", "ivl.phase", "sil.time_ms")
_PERIOD_MS, _MEASURED_S, _CONNECTED_S = 10, 3.0, 30.0


def measure() -> dict[str, float]:
    """Vehicle time per wall time while a block of log variables streams at 100 Hz, and the share of packets missing.

    Raises:
        LinkError: cflib did not connect, or received nothing.
    """
    cflib.crtp.init_drivers()
    seen: list[tuple[float, int]] = []
    with SilProcess(World(), speed=None) as server:
        cf, connected = Crazyflie(), threading.Event()
        cf.fully_connected.add_callback(lambda _: connected.set())
        cf.open_link(server.uri)
        try:
            if not connected.wait(_CONNECTED_S):
                raise LinkError(f"{server.uri}: cflib did not connect within {_CONNECTED_S:g} s")
            block = LogConfig("stream", _PERIOD_MS)
            for name in _NAMES:
                block.add_variable(name)
            cf.log.add_config(block)
            block.data_received_cb.add_callback(
                lambda _, data, __: seen.append((time.monotonic(), data["sil.time_ms"]))
            )
            block.start()
            time.sleep(_MEASURED_S)
        finally:
            cf.close_link()
    rows = list(seen)
    if len(rows) < 2:
        raise LinkError(f"{server.uri}: no log packets")
    (first_s, first_ms), (last_s, last_ms) = rows[0], rows[-1]
    n_expected = 1 + (last_ms - first_ms) / _PERIOD_MS
    return {
        "udp_free_times_real_time": 1e-3 * (last_ms - first_ms) / (last_s - first_s),
        "udp_free_packets_missing": 1.0 - len(rows) / n_expected,
    }
