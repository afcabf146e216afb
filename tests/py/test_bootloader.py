"""Flashing, with the vehicle played by a double behind cflib's own bootloader code."""

import re
from collections.abc import Callable
from pathlib import Path

import cflib.crtp
import pytest
from flash_double import BOOT_URI, BUILD, FIRST, PAGE, URI, Crazyflie, Link, image

from ivl import bootloader, flash
from ivl.errors import ConfigError, LinkError

Switched = Callable[..., Crazyflie]


@pytest.fixture
def switched_on(monkeypatch: pytest.MonkeyPatch) -> Switched:
    """A vehicle in the air between radio and test; nothing waits in real time."""

    def switch_on(**about: object) -> Crazyflie:
        vehicle = Crazyflie(**about)  # type: ignore[arg-type]
        clock = [0.0]

        def pass_time(seconds: float = 0.1) -> float:
            clock[0] += seconds
            return clock[0]

        monkeypatch.setattr(cflib.crtp, "init_drivers", lambda *_, **__: None)
        monkeypatch.setattr(cflib.crtp, "get_link_driver", lambda uri, *_, **__: Link(uri, vehicle))
        monkeypatch.setattr(bootloader, "build", lambda _: vehicle.build())
        for name in ("time.sleep", "time.time", "time.monotonic"):
            monkeypatch.setattr(name, pass_time)
        return vehicle

    return switch_on


def checked(tmp_path: Path, content: bytes) -> flash.Image:
    path = tmp_path / "cf2.bin"
    path.write_bytes(content)
    return flash.check_image(path)


def run(wanted: flash.Image, device: str | None = None) -> tuple[bootloader.Running, list[str]]:
    told: list[str] = []
    now = bootloader.flash(URI, wanted, lambda what, _: told.append(what), device=device)
    return now, told


@pytest.mark.parametrize("size", [4 * flash.VECTORS + 100, PAGE, 10 * PAGE, 10 * PAGE + 4, 23 * PAGE + 1000])
def test_every_byte_is_written_read_back_and_running(tmp_path: Path, switched_on: Switched, size: int) -> None:
    vehicle = switched_on()
    wanted = checked(tmp_path, image(size=size))
    now, told = run(wanted)
    assert vehicle.firmware().startswith(wanted.content)
    assert not vehicle.in_bootloader
    assert now == bootloader.Running("Crazyflie 2.1", BUILD)
    assert {"writing", "reading back", "restarting"} == set(told)


def test_an_image_for_another_vehicle_is_refused_before_anything_is_written(
    tmp_path: Path, switched_on: Switched
) -> None:
    for there in ("Crazyflie 2.1 Brushless", "Crazyflie Bolt 1.1", "Crazyflie 2.0", "Something else"):
        vehicle = switched_on(device=there)
        with pytest.raises(ConfigError, match=rf"is for Crazyflie 2.1; the vehicle at {URI} is a {there}$"):
            run(checked(tmp_path, image()))
        assert vehicle.n_written == 0
        assert not vehicle.in_bootloader


@pytest.mark.parametrize("page", [0, 9, 10, 22])
def test_a_bit_that_flips_on_the_way_is_found(tmp_path: Path, switched_on: Switched, page: int) -> None:
    vehicle = switched_on()
    vehicle.spoils_page = FIRST + page
    with pytest.raises(LinkError, match=f"page {FIRST + page} is not what was written: flash again"):
        run(checked(tmp_path, image(size=23 * PAGE)))
    assert vehicle.in_bootloader, "it does not start what it should not run"


def test_a_page_that_is_not_taken_is_named(tmp_path: Path, switched_on: Switched) -> None:
    switched_on().refuses_page = FIRST + 12
    with pytest.raises(LinkError, match=rf"page {FIRST + 10} was not written \(code 3\)"):
        run(checked(tmp_path, image(size=23 * PAGE)))


def test_a_restart_that_does_not_happen_is_no_success(tmp_path: Path, switched_on: Switched) -> None:
    switched_on().is_deaf_to_restart = True
    with pytest.raises(LinkError, match="the restart was not confirmed"):
        run(checked(tmp_path, image()))


def test_firmware_that_does_not_start_is_no_success(tmp_path: Path, switched_on: Switched) -> None:
    vehicle = switched_on()
    wanted = checked(tmp_path, image())
    answered = vehicle.answers

    def dies(packet: object, at_bootloader: bool) -> list[object]:
        vehicle.starts = vehicle.n_written == 0
        return answered(packet, at_bootloader)

    vehicle.answers = dies  # type: ignore[method-assign,assignment]
    with pytest.raises(LinkError, match="the image is written, but the vehicle did not come back"):
        run(wanted)


def test_a_vehicle_that_runs_something_else_afterwards_is_no_success(
    tmp_path: Path, switched_on: Switched, monkeypatch: pytest.MonkeyPatch
) -> None:
    switched_on()
    monkeypatch.setattr(bootloader, "build", lambda _: 0x1)
    with pytest.raises(LinkError, match=f"runs Crazyflie 2.1, build 00000001, not Crazyflie 2.1, build {BUILD:08x}"):
        run(checked(tmp_path, image()))


def test_a_vehicle_that_waits_in_its_bootloader_is_found_there(tmp_path: Path, switched_on: Switched) -> None:
    vehicle = switched_on(is_waiting=True)
    wanted = checked(tmp_path, image())
    assert BOOT_URI != URI
    with pytest.raises(LinkError, match=r"no vehicle answers .*--cold"):
        run(wanted)
    with pytest.raises(ConfigError, match="is a Crazyflie Bolt"):
        run(wanted, "Crazyflie Bolt")
    now, _ = run(wanted, "Crazyflie 2.1")
    assert now.build == BUILD
    assert vehicle.firmware().startswith(wanted.content)


def test_a_cold_start_without_a_bootloader_says_what_to_do(tmp_path: Path, switched_on: Switched) -> None:
    switched_on()
    with pytest.raises(LinkError, match="hold the button while the vehicle is switched on"):
        run(checked(tmp_path, image()), "Crazyflie 2.1")


def test_another_chip_is_not_written(tmp_path: Path, switched_on: Switched) -> None:
    vehicle = switched_on()
    vehicle.first_page = 88
    with pytest.raises(LinkError, match="begins at 0x08016000"):
        run(checked(tmp_path, image()))
    assert vehicle.n_written == 0


def test_a_stock_image_is_confirmed_by_the_vehicle_alone(tmp_path: Path, switched_on: Switched) -> None:
    switched_on()
    now, _ = run(checked(tmp_path, image(build=None)))
    assert now == bootloader.Running("Crazyflie 2.1", None)


def test_cflibs_own_fault_is_one_line_with_the_link(
    tmp_path: Path, switched_on: Switched, monkeypatch: pytest.MonkeyPatch
) -> None:
    switched_on()

    def no_dongle(*_: object, **__: object) -> None:
        raise OSError("no such device")

    monkeypatch.setattr(cflib.crtp, "get_link_driver", no_dongle)
    with pytest.raises(LinkError, match=re.escape(f"{URI}: no such device (is a Crazyradio plugged in")):
        run(checked(tmp_path, image()))
