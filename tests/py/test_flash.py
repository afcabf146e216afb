import json
import re
import struct
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import pytest
from flash_double import BUILD, ENTRY, STACK, URI, image

from ivl import bootloader, cli, flash
from ivl.errors import ConfigError, LinkError


def write_image(path: Path, **about: Any) -> Path:
    path.write_bytes(image(**about))
    return path


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str], code: int) -> str:
    assert cli.run(["flash", *arguments]) == code
    printed = capsys.readouterr()
    assert printed.out == ""
    return printed.err


@pytest.mark.parametrize("uri", [URI, "radio://1/0/250K", "radio://0/125/1M/e7e7e7e701"])
def test_uri_of_a_radio_is_taken(uri: str) -> None:
    assert flash.check_uri(uri) == uri


@pytest.mark.parametrize(
    "uri",
    ["", "radio://0", "radio://0/80", "radio://0/126/2M", "radio://0/80/3M", "radio://0/80/2M/E7E7", "usb://0",
     "udp://127.0.0.1:19850", f"{URI} ", f"{URI}\n"],
)  # fmt: skip
def test_uri_that_is_no_radio_is_refused_with_what_is_expected(uri: str) -> None:
    with pytest.raises(ConfigError, match="expected radio://"):
        flash.check_uri(uri)


def test_image_is_described(tmp_path: Path) -> None:
    path = write_image(tmp_path / "cf2.bin")
    assert flash.check_image(path) == flash.Image(path, image(), ("Crazyflie 2.1",), BUILD)
    assert flash.check_image(write_image(path, build=None)).build is None
    assert flash.check_image(write_image(path, stack=0x1001_0000)).build == BUILD


@pytest.mark.parametrize("device", flash.DEVICES)
def test_an_image_tells_the_vehicles_that_it_starts_on(tmp_path: Path, device: str) -> None:
    path = write_image(tmp_path / "cf2.bin", device=device)
    assert flash.check_image(path).devices == (device,)


def test_an_image_for_no_vehicle_is_refused(tmp_path: Path) -> None:
    for name in ("Crazyflie", "Crazyflie 2.1x", "My Crazyflie 2.1"):
        with pytest.raises(ConfigError, match="names no vehicle that it starts on"):
            flash.check_image(write_image(tmp_path / "cf2.bin", device=name))


@pytest.mark.parametrize("word", range(1, flash.VECTORS))
def test_every_vector_is_looked_at(tmp_path: Path, word: int) -> None:
    content = bytearray(image())
    for wrong in (0x0800_4100, 0x0800_0001, flash.FLASH_START + len(content) + 1, 0xFFFF_FFFF):
        struct.pack_into("<I", content, 4 * word, wrong)
        (tmp_path / "cf2.bin").write_bytes(content)
        with pytest.raises(ConfigError, match=f"vector {word} 0x{wrong:08x}"):
            flash.check_image(tmp_path / "cf2.bin")


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 7, 64])
def test_bytes_too_many_or_missing_in_front_or_at_the_end_are_found(tmp_path: Path, n: int) -> None:
    good = image()
    path = tmp_path / "cf2.bin"
    (tmp_path / "cf2.elf").write_bytes(elf(good))
    for content in (good + bytes(n), good[:-n], bytes(n) + good, good[n:]):
        path.write_bytes(content)
        with pytest.raises(ConfigError):
            flash.check_image(path)
    path.write_bytes(good)
    assert flash.check_image(path).content == good


def elf(content: bytes, cut: int = 1000, gap: int = 0) -> bytes:
    """A program of 32 bits in two segments, the second one first.

    The first one begins with the headers of the file. One section is not loaded, and one has no bytes.
    """
    begins, n = 52 + 2 * 32 + 4 * 40, len(content)
    head = struct.pack("<4sBB10xHHIIIIIHHHHHH", b"\x7fELF", 1, 1, 2, 40, 1, ENTRY, 52, 116, 0, 52, 32, 2, 40, 4, 0)
    first = struct.pack("<8I", 1, 0, 0, flash.FLASH_START - begins, begins + cut - gap, begins + cut - gap, 5, 4)
    second = struct.pack("<8I", 1, begins + cut, 0x2000_0000, flash.FLASH_START + cut, n - cut, n, 6, 4)
    sections = [(1, 2, begins, cut - gap), (1, 6, begins + cut, n - cut), (8, 3, 0, 99), (1, 0, 0, 50)]
    table = b"".join(struct.pack("<10I", 0, kind, flags, 0, at, size, 0, 0, 4, 0) for kind, flags, at, size in sections)
    return head + second + first + table + content


def test_what_an_elf_file_loads(tmp_path: Path) -> None:
    good = image()
    assert flash.loaded(elf(good)) == good
    assert flash.loaded(elf(good, gap=8)) == good[:992] + bytes(8) + good[1000:]
    for bad in (b"", b"\x7fELF\x02\x01" + bytes(60), elf(good)[:60]):
        path = write_image(tmp_path / "cf2.bin")
        (tmp_path / "cf2.elf").write_bytes(bad)
        with pytest.raises(ConfigError, match=r"cf2\.elf: cannot be read"):
            flash.check_image(path)


def release(path: Path, files: dict[str, Any], content: dict[str, bytes], version: Any = 2) -> Path:
    with zipfile.ZipFile(path, "w") as made:
        made.writestr("manifest.json", json.dumps({"version": version, "files": files}))
        for name, data in content.items():
            made.writestr(name, data)
    return path


STM32 = {"platform": "cf2", "target": "stm32", "type": "fw", "release": "2026.08"}
NRF51 = {"platform": "cf2", "target": "nrf51", "type": "fw", "release": "2026.08"}


def test_the_main_processors_firmware_of_a_release_is_taken(tmp_path: Path) -> None:
    good = image(build=None)
    for target in ("stm32", ["stm32"], ["nrf51", "stm32"]):
        files = {"radio.bin": NRF51, "cf2.bin": {**STM32, "target": target}}
        path = release(tmp_path / "firmware.zip", files, {"radio.bin": b"x", "cf2.bin": good})
        assert flash.check_image(path) == flash.Image(path, good, ("Crazyflie 2.1",), None)


@pytest.mark.parametrize(
    ("files", "content", "version", "said"),
    [
        ({"r.bin": NRF51}, {"r.bin": b"x"}, 2, "0 files are firmware"),
        ({"a": STM32, "b": STM32}, {"a": b"", "b": b""}, 2, "2 files are firmware"),
        ({"cf2.bin": STM32}, {}, 2, "cf2.bin: cannot be read"),
        ({"cf2.bin": STM32}, {"cf2.bin": bytes(flash.FLASH_SIZE + 1)}, 2, "out of range"),
        ({"cf2.bin": STM32}, {"cf2.bin": b"x"}, 3, "version 3"),
        ({"cf2.bin": STM32}, {"cf2.bin": b"x"}, "1", "version '1'"),
        ({"cf2.bin": STM32}, {"cf2.bin": bytes(4096)}, 1, "is no firmware"),
        ([1], {}, 2, "is no manifest"),
    ],
)  # fmt: skip
def test_a_release_that_is_not_one_is_refused(
    tmp_path: Path, files: Any, content: dict[str, bytes], version: Any, said: str
) -> None:
    path = release(tmp_path / "firmware.zip", files, content, version)
    with pytest.raises(ConfigError, match=said) as caught:
        flash.check_image(path)
    assert "\n" not in str(caught.value)


def test_a_zip_without_a_manifest_or_cut_off_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "firmware.zip"
    with zipfile.ZipFile(path, "w") as made:
        made.writestr("cf2.bin", image())
    with pytest.raises(ConfigError, match=r"manifest\.json: cannot be read"):
        flash.check_image(path)
    whole = release(path, {"cf2.bin": STM32}, {"cf2.bin": image()}).read_bytes()
    for n in range(1, len(whole), 97):
        path.write_bytes(whole[:n])
        with pytest.raises(ConfigError):
            flash.check_image(path)


@pytest.mark.parametrize(
    ("stack", "entry"),
    [(0, ENTRY), (0xFFFF_FFFF, 0xFFFF_FFFF), (0x2000_0000, ENTRY), (0x2002_0004, ENTRY), (STACK, ENTRY - 1),
     (STACK, 0x0800_0001), (STACK, flash.FLASH_START + 4097), (STACK, 0)],
)  # fmt: skip
def test_image_that_does_not_begin_like_a_program_is_refused(tmp_path: Path, stack: int, entry: int) -> None:
    path = write_image(tmp_path / "cf2.bin", stack=stack, entry=entry)
    with pytest.raises(ConfigError, match=re.escape(str(path)) + ".*is no firmware"):
        flash.check_image(path)


def test_image_of_a_wrong_size_or_kind_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "cf2.bin"
    with pytest.raises(ConfigError, match="cannot be read"):
        flash.check_image(path)
    path.write_bytes(b"")
    with pytest.raises(ConfigError, match="size 0 bytes"):
        flash.check_image(path)
    write_image(path, size=flash.FLASH_SIZE + 1)
    with pytest.raises(ConfigError, match=f"allowed up to {flash.FLASH_SIZE}"):
        flash.check_image(path)
    path.write_bytes(b"\x7fELF" + bytes(100))
    with pytest.raises(ConfigError, match="ELF"):
        flash.check_image(path)


def test_an_image_is_known_by_what_the_app_prints() -> None:
    source = (Path(__file__).parents[2] / "firmware" / "app" / "app_main.c").read_text(encoding="utf-8")
    printed = re.search(r'DEBUG_PRINT\("([^"]*)" APP_TEXT\(IVL_BUILD\) "([^"]*)"\)', source)
    assert printed is not None
    text = (printed[1] + "0x0123abcd" + printed[2].replace("\\n", "\n")).encode()
    assert flash._BUILD.fullmatch(text)


def test_command_refuses_bad_arguments(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good = write_image(tmp_path / "cf2.bin")
    stock = write_image(tmp_path / "stock.bin", build=None)
    assert "--uri" in refused([str(good), "--uri", "udp://127.0.0.1"], capsys, 2)
    assert "nothing.bin" in refused([str(tmp_path / "nothing.bin"), "--uri", URI], capsys, 2)
    assert "--any" in refused([str(stock), "--uri", URI], capsys, 2)
    assert "uri" in refused([str(good)], capsys, 2)
    assert "--cold" in refused([str(good), "--uri", URI, "--cold", "Crazyflie 3"], capsys, 2)


def test_command_says_what_is_missing_on_this_machine(tmp_path: Path) -> None:
    """With neither cflib nor a radio, or with cflib and no radio: one line that names it."""
    path = write_image(tmp_path / "cf2.bin")
    command = [
        sys.executable,
        "-c",
        "from ivl.cli import main; main()",
        "flash",
        "--uri",
        "radio://9/80/2M",
        str(path),
    ]
    run = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert run.returncode == 1
    last = run.stderr.strip().splitlines()[-1]
    assert "pip install 'ivl[link]'" in last or "radio://9/80/2M" in last
    assert "Traceback" not in run.stderr


def test_missing_cflib_is_named_with_the_extra_that_brings_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cflib", None)
    wanted = flash.check_image(write_image(tmp_path / "cf2.bin"))
    with pytest.raises(LinkError, match=re.escape("pip install 'ivl[link]'")):
        bootloader.flash(URI, wanted, print)
