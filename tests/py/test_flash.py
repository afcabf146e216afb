import re
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from ivl import cli, flash
from ivl.errors import ConfigError, LinkError

URI = "radio://0/80/2M/E7E7E7E7E7"
STACK, ENTRY = 0x2002_0000, 0x0800_4201


def write_image(path: Path, stack: int = STACK, entry: int = ENTRY, size: int = 4096, mark: bytes = flash.MARK) -> Path:
    path.write_bytes((struct.pack("<II", stack, entry) + mark).ljust(size, b"\xff"))
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
    assert flash.check_image(path) == flash.Image(path, 4096, True)
    assert not flash.check_image(write_image(path, mark=b"")).has_app
    assert flash.check_image(write_image(path, stack=0x1001_0000)).has_app


@pytest.mark.parametrize(
    ("stack", "entry"),
    [(0, ENTRY), (0xFFFF_FFFF, 0xFFFF_FFFF), (0x2000_0000, ENTRY), (0x2002_0004, ENTRY), (STACK, ENTRY - 1),
     (STACK, 0x0800_0001), (STACK, flash.FLASH_START + 4097)],
)  # fmt: skip
def test_image_that_does_not_begin_like_a_program_is_refused(tmp_path: Path, stack: int, entry: int) -> None:
    path = write_image(tmp_path / "cf2.bin", stack, entry)
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
    with pytest.raises(ConfigError, match=f"allowed 8 .. {flash.FLASH_SIZE}"):
        flash.check_image(path)
    path.write_bytes(b"\x7fELF" + bytes(100))
    with pytest.raises(ConfigError, match="ELF"):
        flash.check_image(path)


def test_mark_is_what_the_app_prints() -> None:
    source = Path(__file__).parents[2] / "firmware" / "app" / "app_main.c"
    assert f'DEBUG_PRINT("{flash.MARK.decode()}\\n")' in source.read_text(encoding="utf-8")


def test_command_refuses_bad_arguments(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good = write_image(tmp_path / "cf2.bin")
    stock = write_image(tmp_path / "stock.bin", mark=b"")
    assert "--uri" in refused([str(good), "--uri", "udp://127.0.0.1"], capsys, 2)
    assert "nothing.bin" in refused([str(tmp_path / "nothing.bin"), "--uri", URI], capsys, 2)
    assert "--any" in refused([str(stock), "--uri", URI], capsys, 2)
    assert "uri" in refused([str(good)], capsys, 2)


def test_command_says_what_is_missing_on_this_machine(tmp_path: Path) -> None:
    """With neither cflib nor a radio, or with cflib and no radio: one line that names it."""
    image = write_image(tmp_path / "cf2.bin")
    command = [
        sys.executable,
        "-c",
        "from ivl.cli import main; main()",
        "flash",
        "--uri",
        "radio://9/80/2M",
        str(image),
    ]
    run = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert run.returncode == 1
    last = run.stderr.strip().splitlines()[-1]
    assert "pip install 'ivl[link]'" in last or "radio://9/80/2M" in last
    assert "Traceback" not in run.stderr


def test_missing_cflib_is_named_with_the_extra_that_brings_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cflib", None)
    image = flash.check_image(write_image(tmp_path / "cf2.bin"))
    with pytest.raises(LinkError, match=re.escape("pip install 'ivl[link]'")):
        flash.flash(URI, image, print)
