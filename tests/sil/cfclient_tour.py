"""Bitcraze's graphical client, unmodified and offscreen, at a software vehicle: what this vehicle has is clicked once.

Run by test_cfclient.py and by tools/clients.py, in a process of its own:  python cfclient_tour.py URI PICTURE
Only the buttons, lists and fields that a person would use are touched. A thing counts if the client then shows what it
shows with a real vehicle. What came of each goes into a JSON file beside the picture; the exit code is 1 if one failed.
"""

import contextlib
import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import cfclient
from cfclient.ui.main import MainUI
from PyQt6.QtCore import QModelIndex, QObject, Qt
from PyQt6.QtWidgets import (
    QAbstractButton,
    QApplication,
    QComboBox,
    QDoubleSpinBox,
    QLabel,
    QLineEdit,
    QProgressBar,
    QPushButton,
    QTextEdit,
    QTreeView,
    QTreeWidget,
    QWidget,
)

STEP_S = 90.0  # deadline of each step, for a slow machine
MOVED_M = 0.2  # a click on an arrow asks for half a metre
T = TypeVar("T", bound=QObject)


class Tour:
    """The client's window, looked at and clicked."""

    def __init__(self, application: QApplication, uri: str, picture: Path) -> None:
        self.application, self.uri, self.picture = application, uri, picture
        self.volts = 0.0
        self.plotted: list[str] = []
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

    def show(self, name: str) -> None:
        """Open a tab by the menu."""
        action = next(a for a in self.window.tabs_menu_item.actions() if a.text() == name)
        if not action.isChecked():
            action.trigger()
        tabs = self.window.tab_widget
        tabs.setCurrentIndex(next(i for i in range(tabs.count()) if tabs.tabText(i) == name))
        self.live(0.05)

    def click(self, name: str, of: QObject | None = None) -> None:
        button = (of or self.window).findChild(QAbstractButton, name)
        if button is None:
            raise LookupError(f"the client has no button named {name}")
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


# ---- the top row


def scan(tour: Tour) -> str:
    tour.wait("the first scan is over", tour.find(QAbstractButton, "scanButton").isEnabled)
    tour.click("scanButton")
    combo = tour.find(QComboBox, "interfaceCombo")
    tour.wait(f"the scan finds {tour.uri}", lambda: combo.findText(tour.uri) >= 0)
    combo.setCurrentIndex(combo.findText(tour.uri))
    return combo.currentText()


def connect(tour: Tour) -> str:
    tour.click("connectButton")
    tour.wait("connected", lambda: tour.find(QAbstractButton, "connectButton").text() == "Disconnect")
    tour.wait("the battery shows", lambda: tour.number("_aff_volts") > 3.0)
    tour.wait("the position shows", lambda: tour.text("estimateZ") != "")
    tour.wait("all parameters have come", lambda: tour.window.cf.param.is_updated)
    tour.volts = tour.number("_aff_volts")
    return f"{tour.volts} V"


def emergency_stop(tour: Tour) -> str:
    tour.show("Flight Control")
    tour.click("esButton")
    tour.wait("locked", lambda: tour.text("_supervisor_state").startswith("Locked"))
    return tour.text("_supervisor_state")


def disconnect(tour: Tour) -> str:
    tour.click("connectButton")
    button = tour.find(QAbstractButton, "connectButton")
    tour.wait("disconnected", lambda: button.text() == "Connect")
    return button.text()


# ---- the flight tab


def arm(tour: Tour) -> str:
    tour.show("Flight Control")
    button = tour.find(QAbstractButton, "armButton")
    if button.text() != "Arm" or abs(tour.number("estimateZ")) > 0.1:
        raise ValueError(f"the button says {button.text()!r}, the height is {tour.text('estimateZ')}")
    tour.click("armButton")
    tour.wait("armed", lambda: button.text() == "Disarm")
    tour.wait("the flight panel is on", tour.find(QWidget, "commanderBox").isEnabled)
    return button.text()


def take_off(tour: Tour) -> str:
    tour.click("commanderTakeOffButton")
    tour.wait("flying", lambda: tour.text("_supervisor_state") == "Flying")
    tour.wait("half a metre up", lambda: tour.number("estimateZ") > 0.45)
    tour.wait("a motor runs", lambda: tour.find(QProgressBar, "actualM1").value() > 0)
    return f"{tour.text('estimateZ')} m"


def move(name: str, field: str, sign: float) -> Callable[[Tour], str]:
    """A click on an arrow, and the way that the vehicle goes."""

    def go(tour: Tour) -> str:
        before = tour.number(field)
        tour.click(name)
        tour.wait(f"{field} has moved", lambda: sign * (tour.number(field) - before) > MOVED_M)
        if field != "estimateZ":  # it leans into the motion
            tour.seen("estimatePitch", 3)
        tour.live(0.5)
        return f"{tour.number(field) - before:+.2f} m"

    return go


def picture(tour: Tour) -> str:
    """The window in flight, the battery lower than before."""
    tour.wait("the battery sinks", lambda: tour.number("_aff_volts") < tour.volts)
    tour.window.grab().save(str(tour.picture))
    return f"{tour.text('_aff_volts')} V"


def land(tour: Tour) -> str:
    tour.click("commanderLandButton")
    tour.wait("on the floor", lambda: tour.number("estimateZ") < 0.1)
    tour.wait("not flying", lambda: tour.text("_supervisor_state") != "Flying")
    return f"{tour.text('estimateZ')} m"


def disarm(tour: Tour) -> str:
    button = tour.find(QAbstractButton, "armButton")
    tour.wait("it can be disarmed, or has done so by itself", lambda: button.text() in ("Disarm", "Arm"))
    if button.text() == "Disarm":
        tour.click("armButton")
    tour.wait("disarmed", lambda: button.text() == "Arm")
    return button.text()


# ---- logs


def shipped() -> set[str]:
    """What the client calls the log configurations that it brings: their paths."""
    folder = Path(cfclient.__file__).parent / "configs" / "log"
    return {path.relative_to(folder).with_suffix("").as_posix() for path in folder.rglob("*.json")}


def plot(tour: Tour) -> str:
    """Each log configuration that the client brings is chosen in the plotter, and a curve of each variable is drawn."""
    tour.show("Plotter")
    selector = tour.find(QComboBox, "dataSelector")
    plotter = tour.window.loaded_tab_toolboxes["Plotter"]

    def drawn(names: set[str]) -> bool:
        curves = plotter._plot._items
        return set(curves) == names and all(len(curve.data) > 2 for curve in curves.values())

    for i in range(selector.count()):
        name = selector.itemText(i)
        if name in shipped():
            variables = {variable.name for variable in selector.model().get_config(i).variables}
            selector.setCurrentIndex(i)
            with contextlib.suppress(TimeoutError):
                tour.wait(f"{name} draws", lambda variables=variables: drawn(variables))
                tour.plotted.append(name)
    if set(tour.plotted) != shipped():
        raise ValueError(f"did not draw: {', '.join(sorted(shipped() - set(tour.plotted)))}")
    return f"{len(tour.plotted)} configurations"


def block_row(tour: Tour, name: str) -> Callable[[int], QModelIndex]:
    tree = tour.find(QTreeView, "_block_tree")
    model = tree.model()
    items = [model.index(i, 1, QModelIndex()).internalPointer() for i in range(model.rowCount(QModelIndex()))]
    row = [item.name for item in items].index(name)
    return lambda column: model.index(row, column, QModelIndex())


def start_block(tour: Tour) -> str:
    tour.show("Log Blocks")
    at = block_row(tour, "stabilizer")
    if at(3).internalPointer().logging_started():  # the plotter drew it last
        stop_block(tour)
    tour.find(QTreeView, "_block_tree").clicked.emit(at(3))
    tour.wait("the block runs", lambda: at(3).internalPointer().logging_started())
    return "stabilizer runs"


def write_block(tour: Tour) -> str:
    at = block_row(tour, "stabilizer")
    tour.find(QTreeView, "_block_tree").clicked.emit(at(4))
    tour.wait("it is written", lambda: at(4).internalPointer().writing_to_file())
    tour.live(0.3)
    tour.find(QTreeView, "_block_tree").clicked.emit(at(4))
    tour.wait("it is written no more", lambda: not at(4).internalPointer().writing_to_file())
    return "written to a file"


def stop_block(tour: Tour) -> str:
    at = block_row(tour, "stabilizer")
    tour.find(QTreeView, "_block_tree").clicked.emit(at(3))
    tour.wait("the block stands", lambda: not at(3).internalPointer().logging_started())
    return "stabilizer stands"


def list_logs(tour: Tour) -> str:
    tour.show("Log TOC")
    tree = tour.find(QTreeWidget, "logTree")
    found = tree.findItems("stateEstimate", Qt.MatchFlag.MatchExactly)
    if len(found) != 1 or found[0].childCount() < 10:
        raise ValueError(f"{tree.topLevelItemCount()} groups")
    return f"{tree.topLevelItemCount()} groups"


# ---- parameters


def choose(tour: Tour, group: str, name: str) -> None:
    tour.show("Parameters")
    tree = tour.find(QTreeView, "paramTree")
    model = tree.model()

    def row(parent: QModelIndex, wanted: str) -> QModelIndex:
        rows = (model.index(i, 0, parent) for i in range(model.rowCount(parent)))
        return next(index for index in rows if index.data() == wanted)

    tree.setCurrentIndex(row(row(QModelIndex(), group), name))
    tour.wait("its name shows", lambda: tour.find(QLabel, "paramDetailsLabel").text() == f"{group}.{name}")
    tour.wait("its default shows", lambda: tour.find(QLabel, "defaultValue").text() != "-")


def held(tour: Tour, name: str, value: float) -> Callable[[], bool]:
    return lambda: float(tour.window.cf.param.get_value(name)) == value


def set_parameter(tour: Tour) -> str:
    choose(tour, "ring", "effect")
    tour.find(QLineEdit, "currentValue").setText("7")
    tour.click("setParamButton")
    tour.wait("the vehicle has it", held(tour, "ring.effect", 7))
    return "ring.effect 7"


def store_parameter(tour: Tour) -> str:
    choose(tour, "ring", "effect")
    button = tour.find(QPushButton, "persistentButton")
    tour.wait("it can be stored", lambda: button.isVisible() and button.text() == "Store")
    tour.click("persistentButton")
    tour.wait("it is stored", lambda: button.text() == "Clear")
    return f"stored {tour.find(QLabel, 'storedValue').text()}"


def clear_parameter(tour: Tour) -> str:
    button = tour.find(QPushButton, "persistentButton")
    tour.click("persistentButton")
    tour.wait("it is not stored", lambda: button.text() == "Store")
    return tour.find(QLabel, "storedValue").text()


def reset_parameter(tour: Tour) -> str:
    choose(tour, "ring", "effect")
    default = float(tour.find(QLabel, "defaultValue").text())
    tour.click("resetDefaultButton")
    tour.live(0.1)
    tour.click("setParamButton")
    tour.wait("the vehicle has its default", held(tour, "ring.effect", default))
    return f"ring.effect {default:g}"


# ---- console


def ask_console(name: str, words: str) -> Callable[[Tour], str]:
    """A button of the console tab, and what the vehicle says."""

    def ask(tour: Tour) -> str:
        tour.show("Console")
        console = tour.find(QTextEdit, "console")
        tour.click("_clearButton", tour.window.loaded_tab_toolboxes["Console"])
        tour.click(name)
        tour.wait(f"it says {words!r}", lambda: words in console.toPlainText())
        return words

    return ask


# ---- tuning


def sliders(tour: Tour) -> dict[str, QDoubleSpinBox]:
    tab = tour.window.loaded_tab_toolboxes["Tuning"]
    return {name: mapper.slider.input for name, mapper in tab.mappers.items()}


def tune(tour: Tour) -> str:
    tour.show("Tuning")
    fields = sliders(tour)
    tour.wait("a gain shows", lambda: fields["pid_rate.roll_kp"].value() == 250.0)
    tour.wait("another gain shows", lambda: fields["posCtlPid.zKp"].value() == 2.0)
    fields["pid_rate.yaw_kp"].setValue(111.0)
    tour.wait("the vehicle has it", held(tour, "pid_rate.yaw_kp", 111.0))
    return f"{len(fields)} gains"


def store_gains(tour: Tour) -> str:
    tour.click("store_button")
    choose(tour, "pid_rate", "yaw_kp")
    tour.wait("it is stored", lambda: tour.find(QLabel, "storedValue").text() not in ("", "Not stored", "-"))
    return f"pid_rate.yaw_kp stored {tour.find(QLabel, 'storedValue').text()}"


def clear_gains(tour: Tour) -> str:
    tour.show("Tuning")
    tour.click("clear_stored_button")
    tour.live(1.0)
    choose(tour, "pid_rate", "roll_kp")
    choose(tour, "pid_rate", "yaw_kp")
    tour.wait("it is not stored", lambda: tour.find(QLabel, "storedValue").text() == "Not stored")
    return "none stored"


def default_gains(tour: Tour) -> str:
    tour.show("Tuning")
    tour.click("default_values_button")
    tour.wait("the first value shows", lambda: sliders(tour)["pid_rate.yaw_kp"].value() == 120.0)
    return "pid_rate.yaw_kp 120"


# ---- the memory of its own


def configure(tour: Tour) -> str:
    action = tour.window._menu_cf2_config
    tour.wait("the menu is on", action.isEnabled)
    action.trigger()
    dialog = tour.window._cf2config_dialog
    tour.wait("it was read", dialog._write_data_btn.isEnabled)
    dialog._pitch_trim.setValue(0.5)
    tour.click("_write_data_btn", dialog)
    tour.wait("it was written and read back", dialog._write_data_btn.isEnabled)
    if abs(dialog._pitch_trim.value() - 0.5) > 1e-6:
        raise ValueError(f"pitch trim {dialog._pitch_trim.value()}")
    channel = dialog._radio_channel.value()
    tour.click("_exit_btn", dialog)
    return f"channel {channel}, pitch trim 0.5"


THINGS: list[tuple[str, Callable[[Tour], str]]] = [
    ("scan", scan),
    ("connect", connect),
    ("arm", arm),
    ("take off", take_off),
    ("up", move("commanderUpButton", "estimateZ", 1.0)),
    ("down", move("commanderDownButton", "estimateZ", -1.0)),
    ("forward", move("commanderForwardButton", "estimateX", 1.0)),
    ("back", move("commanderBackButton", "estimateX", -1.0)),
    ("left", move("commanderLeftButton", "estimateY", 1.0)),
    ("right", move("commanderRightButton", "estimateY", -1.0)),
    ("the window in flight", picture),
    ("land", land),
    ("disarm", disarm),
    ("plotter: each log configuration", plot),
    ("log blocks: start", start_block),
    ("log blocks: write to a file", write_block),
    ("log blocks: stop", stop_block),
    ("log variables", list_logs),
    ("parameters: set", set_parameter),
    ("parameters: store", store_parameter),
    ("parameters: clear", clear_parameter),
    ("parameters: default", reset_parameter),
    ("console: system load", ask_console("_dumpSystemLoadButton", "Task dump")),
    ("console: assertion", ask_console("_dumpAssertInformation", "No assertion has failed")),
    ("console: propeller test", ask_console("_propellerTestButton", "no tests of propellers")),
    ("console: battery test", ask_console("_batteryTestButton", "no tests of propellers and battery")),
    ("console: storage", ask_console("_storageStatsButton", "STORAGE")),
    ("tuning: a gain", tune),
    ("tuning: store", store_gains),
    ("tuning: clear", clear_gains),
    ("tuning: defaults", default_gains),
    ("configuration of its own memory", configure),
    ("emergency stop", emergency_stop),
    ("disconnect", disconnect),
]


def main() -> int:
    uri, to = sys.argv[1], Path(sys.argv[2])
    application = QApplication(sys.argv[:1])
    application.setStyle("Fusion")
    tour = Tour(application, uri, to)
    results: list[dict[str, object]] = []
    for name, do in THINGS:
        try:
            result = {"thing": name, "ok": True, "seen": do(tour)}
        except (LookupError, ValueError, TimeoutError, StopIteration, AttributeError, KeyError) as error:
            result = {"thing": name, "ok": False, "seen": f"{type(error).__name__}: {error}"}
        results.append(result)
        print(f"{'ok' if result['ok'] else 'FAILED':>7}  {name}: {result['seen']}", flush=True)
        if name == "connect" and not result["ok"]:
            break
    to.with_suffix(".json").write_text(json.dumps({"things": results, "plotted": tour.plotted}), encoding="utf-8")
    return 0 if len(results) == len(THINGS) and all(result["ok"] for result in results) else 1


if __name__ == "__main__":
    # some threads of the client never end; what was to be done is done and written
    code = main()
    sys.stdout.flush()
    os._exit(code)
