"""Bitcraze's graphical client, unmodified and offscreen, at a software vehicle: connect, watch, arm, take off, land.

Run by test_cfclient.py in a process of its own:  python cfclient_tour.py URI PICTURE
Only the buttons and labels that a person would use are touched.  What they showed goes into a JSON file beside it.
"""

import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from cfclient.ui.main import MainUI
from PyQt6.QtCore import QObject
from PyQt6.QtWidgets import QAbstractButton, QApplication, QComboBox, QLineEdit, QProgressBar, QWidget

STEP_S = 90.0  # deadline of each step, for a slow machine
T = TypeVar("T", bound=QObject)


class Tour:
    """The client's window, looked at and clicked."""

    def __init__(self, application: QApplication) -> None:
        self.application = application
        self.window = MainUI()
        self.window.resize(1400, 860)
        self.window.show()
        self.window.set_default_theme()

    def find(self, kind: type[T], name: str) -> T:
        found = self.window.findChild(kind, name)
        if found is None:
            raise LookupError(f"the client has no {kind.__name__} named {name}")
        return found

    def text(self, name: str) -> str:
        return self.find(QLineEdit, name).text()

    def number(self, name: str) -> float:
        text = self.text(name)
        return float(text) if text else float("nan")

    def live(self, seconds: float) -> None:
        """Let the client work."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.application.processEvents()
            time.sleep(0.005)

    def wait(self, what: str, condition: Callable[[], bool]) -> None:
        end = time.monotonic() + STEP_S
        while not condition():
            if time.monotonic() > end:
                raise TimeoutError(f"waited {STEP_S} s for: {what}")
            self.live(0.02)

    def click(self, name: str) -> None:
        button = self.find(QAbstractButton, name)
        self.wait(f"{name} can be clicked", button.isEnabled)
        button.click()

    def seen(self, name: str, n: int) -> list[str]:
        """The first n different texts that a field showed."""
        texts: set[str] = set()

        def look() -> bool:
            texts.add(self.text(name))
            return len(texts) >= n

        self.wait(f"{n} texts of {name}", look)
        return sorted(texts)


def connect(tour: Tour, uri: str) -> None:
    tour.wait("the first scan is over", tour.find(QAbstractButton, "scanButton").isEnabled)
    tour.click("scanButton")
    combo = tour.find(QComboBox, "interfaceCombo")
    tour.wait(f"the scan finds {uri}", lambda: combo.findText(uri) >= 0)
    combo.setCurrentIndex(combo.findText(uri))
    tour.click("connectButton")
    tour.wait("connected", lambda: tour.find(QAbstractButton, "connectButton").text() == "Disconnect")
    tour.wait("the battery shows", lambda: tour.number("_aff_volts") > 3.0)
    tour.wait("the position shows", lambda: tour.text("estimateZ") != "")


def fly(tour: Tour, picture: Path) -> dict[str, object]:
    arm = tour.find(QAbstractButton, "armButton")
    shown: dict[str, object] = {
        "height_on_floor_m": tour.number("estimateZ"),
        "arm_before": arm.text(),
        "volts_waiting": tour.number("_aff_volts"),
    }
    tour.click("armButton")
    tour.wait("armed", lambda: arm.text() == "Disarm")
    tour.wait("the flight panel is on", tour.find(QWidget, "commanderBox").isEnabled)
    tour.click("commanderTakeOffButton")
    tour.wait("flying", lambda: tour.text("_supervisor_state") == "Flying")
    tour.wait("half a metre up", lambda: tour.number("estimateZ") > 0.45)
    tour.click("commanderForwardButton")
    shown["pitch_shown"] = tour.seen("estimatePitch", 6)
    shown["motor"] = tour.find(QProgressBar, "actualM1").value()
    shown["height_hovering_m"] = tour.number("estimateZ")
    tour.wait("the battery sinks", lambda: tour.number("_aff_volts") < float(str(shown["volts_waiting"])))
    shown["volts_flying"] = tour.number("_aff_volts")
    tour.window.grab().save(str(picture))
    tour.click("commanderLandButton")
    tour.wait("on the floor", lambda: tour.number("estimateZ") < 0.1)
    return shown


def main() -> int:
    uri, picture = sys.argv[1], Path(sys.argv[2])
    application = QApplication(sys.argv[:1])
    application.setStyle("Fusion")
    tour = Tour(application)
    connect(tour, uri)
    shown = fly(tour, picture)
    tour.click("connectButton")
    tour.wait("disconnected", lambda: tour.find(QAbstractButton, "connectButton").text() == "Connect")
    picture.with_suffix(".json").write_text(json.dumps(shown), encoding="utf-8")
    return 0


if __name__ == "__main__":
    # some threads of the client never end; what was to be done is done and written
    os._exit(main())
