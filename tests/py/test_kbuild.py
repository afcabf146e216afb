"""What the SDK's Kbuild is told to compile, with and without forms of one's own; a small make stands in for the SDK."""

import subprocess
from pathlib import Path

import pytest

REPO = Path(__file__).parents[2]
FIRMWARE = REPO / "firmware"

SDK = """
all:
	@$(MAKE) --no-print-directory -f $(CRAZYFLIE_BASE)/Kbuild_reader OOT=$(OOT)
"""
READER = """
include $(OOT)/Kbuild
$(info flags $(subdir-ccflags-y))
obj-y :=
include $(OOT)/core/Kbuild
$(info core $(obj-y))
obj-y :=
CONFIG_ENABLE_CPX := y
include $(OOT)/app/Kbuild
$(info app $(obj-y))
all: ;
"""


def built(tmp_path: Path, *arguments: str) -> dict[str, list[str]]:
    """What `make -C firmware` hands on to an SDK: flags, and objects of core and app as absolute paths."""
    (tmp_path / "tools" / "make").mkdir(parents=True, exist_ok=True)
    (tmp_path / "tools" / "make" / "oot.mk").write_text(SDK)
    (tmp_path / "Kbuild_reader").write_text(READER)
    command = ["make", "--no-print-directory", "-C", str(FIRMWARE), f"CRAZYFLIE_BASE={tmp_path}", *arguments]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    found = {line.split()[0]: line.split()[1:] for line in text.splitlines()}
    for name in ("core", "app"):
        found[name] = sorted(str((FIRMWARE / name / path).resolve()) for path in found[name])
    return found


def objects_of(*folders: Path) -> list[str]:
    return sorted(str(path.with_suffix(".o").resolve()) for folder in folders for path in folder.glob("*.c"))


def test_the_image_has_every_source_of_core_and_app(tmp_path: Path) -> None:
    found = built(tmp_path)
    assert found["core"] == objects_of(FIRMWARE / "core")
    # app_port.c is for programs that simulate the vehicle
    assert found["app"] == [path for path in objects_of(FIRMWARE / "app") if not path.endswith("app_port.o")]
    assert found["flags"] == []


@pytest.mark.parametrize("folder", ["tests/forms", str(REPO / "tests" / "forms")])
def test_forms_of_ones_own_are_in_the_image_and_core_and_app_know_them(tmp_path: Path, folder: str) -> None:
    found = built(tmp_path, f"FORMS={folder}")
    assert found["core"] == objects_of(FIRMWARE / "core", REPO / "tests" / "forms")
    assert found["flags"] == [f"-I{FIRMWARE}/core", f"-DIVL_FORMS_FILE='\"{REPO}/tests/forms/forms.h\"'"]


def test_a_folder_without_forms_is_refused(tmp_path: Path) -> None:
    with pytest.raises(subprocess.CalledProcessError) as caught:
        built(tmp_path, "FORMS=docs")
    assert f"FORMS=docs: {REPO}/docs/forms.h is missing" in caught.value.stderr
