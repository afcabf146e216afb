"""CSV of Bitcraze's client: a file for each log block, `Timestamp` in milliseconds, then log variables by their names.

The client makes a folder for each connection, with a file for each log block that is written. Files of one folder are
blocks of one connection, on one clock. Its 24 bits start over after 4.7 hours.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ivl.flight import bitcraze
from ivl.flight import table as border
from ivl.flight.log import Format, Given, Log
from ivl.flight.streams import Stream
from ivl.flight.table import Table

_CLOCK_MS = 2.0**24
_CLOCK = "Timestamp, the vehicle's clock in ms, from the first sample of each flight on: "


def load(paths: Sequence[Path], given: Given) -> Log:
    """Read log blocks, folder by folder."""
    flights, files, clock = bitcraze.by_folder(paths, (".csv",), _stream, given)
    return Log(flights, files, bitcraze.FRAMES, _CLOCK + clock, notes=bitcraze.NOTES)


FORMAT = Format("cfclient", "CSV of Bitcraze's client: a file, or a folder with a file for each log block", load)


def _stream(path: Path, given: Given) -> Stream:
    table = border.read_csv(path)
    table.need(["Timestamp"], "format cfclient")
    t_ms = table.numbers("Timestamp", needed=True)
    wraps = np.concatenate([[0.0], np.cumsum(np.diff(t_ms) < -_CLOCK_MS / 2)])
    unwrapped = Table(path, {**table.columns, "Timestamp": t_ms + _CLOCK_MS * wraps}, table.places)
    return bitcraze.stream(path.stem, unwrapped, border.clock(unwrapped, "Timestamp", 1e-3), given)
