"""Bitcraze's graphical client at the software vehicle, with nothing changed in either."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from ivl.silproc import SilProcess
from ivl.world import World

TOUR = Path(__file__).parent / "cfclient_tour.py"
SESSION_ENDS_S = 1.2  # the server gives a session up after a second of silence


@pytest.fixture
def waiting(Raw):
    """A vehicle that waits to be armed by hand, on an address of loopback that nobody else uses, where a scan looks."""
    host = f"127.78.{os.getpid() >> 8 & 255}.{os.getpid() & 255}"
    with SilProcess(World("crazyflie21"), port=19850, bind=host) as sil:
        sil.set("sil.auto_arm", 0)
        sil.set("supervisor.prefltTimeout", 60000)  # a busy machine clicks slowly
        with Raw(sil.uri) as raw:
            assert raw.ask("9d0100")[2:4] == b"\x01\x00"
        time.sleep(SESSION_ENDS_S)
        yield host, sil


def test_everything_in_cfclient_that_the_vehicle_has_does_what_it_does(waiting, tmp_path):
    host, sil = waiting
    picture = Path(os.environ.get("IVL_CFCLIENT_PICTURE", tmp_path / "cfclient.png"))  # to keep it for docs
    environment = {
        **os.environ,
        "HOME": str(tmp_path),
        "XDG_CONFIG_HOME": str(tmp_path),
        "QT_QPA_PLATFORM": "offscreen",
        "SCAN_ADDRESS": host,
    }
    command = [sys.executable, str(TOUR), sil.uri, str(picture)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=900, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-2000:]
    shown = json.loads(picture.with_suffix(".json").read_text(encoding="utf-8"))
    assert len(shown["things"]) >= 28
    assert all(thing["ok"] for thing in shown["things"])
    assert len(shown["plotted"]) == 17
    assert picture.stat().st_size > 20_000
