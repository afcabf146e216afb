"""docs/HOST.md says what the code does: deadlines, checks, rules, exit codes."""

import re
from dataclasses import asdict
from pathlib import Path

from ivl import native, silproc
from ivl.links import clock, pil, preflight, vehicle
from ivl.links.deadlines import DEADLINES
from ivl.startpoint import HEIGHT_M_MIN

PAGE = (Path(__file__).parents[2] / "docs" / "HOST.md").read_text(encoding="utf-8")
TEXT = " ".join(PAGE.split())  # wherever its lines are broken


def test_deadlines_are_those_of_the_code() -> None:
    told = {name: float(value) for name, value in re.findall(r"^\| `(\w+_s\w*)` \| ([\d.]+) \|", PAGE, re.MULTILINE)}
    assert told == {name: value for name, value in asdict(DEADLINES).items() if name != "window"}
    assert f"together with {DEADLINES.window - 1} others (`window`)" in TEXT


def test_numbers_of_the_preflight_are_those_of_the_code() -> None:
    for text in (
        f"{preflight.PINGS_MIN} pings: at most {100 * preflight.LOST_MAX:.0f} % lost, 95 % within "
        f"{1e3 * preflight.P95_S_MAX:.0f} ms",
        f"{preflight.BATTERY_V_MIN:.2f} V at rest",
        f"at most {1e3 * preflight.SIGMA_M_MAX:.0f} mm, within {preflight.SIGMA_S:.0f} s",
        f"below {HEIGHT_M_MIN} m of height",
        f"The command ({1 / clock.FINE.beat_s:.1f} Hz, one packet)",
        f"sent {1 / clock.COARSE.beat_s:.0f} times a second of vehicle time",
        f"has not answered one for {vehicle.UNHEARD_S_MAX} s of its time",
    ):
        assert text in TEXT, text


def test_variables_of_the_environment_are_those_of_the_code() -> None:
    told = re.findall(r"^\| `(IVL_\w+)` \| .* \| `([\w.-]+)`", PAGE, re.MULTILINE)
    assert told == [
        (native.LIBRARY_ENV, native.DEFAULT_LIBRARY.name),
        (silproc.SERVER_ENV, silproc.DEFAULT_SERVER.name),
        (pil.IMAGE_ENV, pil.IMAGE.name),
        (pil.QEMU_ENV, pil.qemu_command(pil.IMAGE)[0]),
    ]
    package = Path(native.__file__).parent
    used = {name for path in package.rglob("*.py") for name in re.findall(r'"(IVL_[A-Z_]+)"', path.read_text("utf-8"))}
    assert used == set(re.findall(r"`(IVL_[A-Z_]+)`", PAGE))
