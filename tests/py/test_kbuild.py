"""What the SDK's Kbuild is told to compile, with and without forms of one's own; a small make stands in for the SDK."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

REPO = Path(__file__).parents[2]
FIRMWARE = REPO / "firmware"

SDK = """
OOT_ARGS = OOT=$(OOT)
what_config:
	@$(MAKE) --no-print-directory -f $(CRAZYFLIE_BASE)/Kbuild_reader OOT=$(OOT)
alldefconfig:
	@echo "chose $(KBUILD_OUTPUT) $(KCONFIG_ALLCONFIG)"
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
    command = ["make", "--no-print-directory", "-C", str(FIRMWARE), f"CRAZYFLIE_BASE={tmp_path}", "what_config"]
    command += arguments
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


def made(tmp_path: Path, *goals: str) -> subprocess.CompletedProcess[str]:
    """`make -C firmware` beside an SDK that was never configured."""
    firmware = tmp_path / "repo" / "firmware"
    if not firmware.exists():
        shutil.copytree(FIRMWARE, firmware, ignore=shutil.ignore_patterns("build"))
        (tmp_path / "crazyflie-firmware" / "tools" / "make").mkdir(parents=True)
        (tmp_path / "crazyflie-firmware" / "tools" / "make" / "oot.mk").write_text(SDK)
    command = ["make", "--no-print-directory", "-C", str(firmware), *goals]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_each_set_of_motors_has_a_configuration_that_names_it(tmp_path: Path) -> None:
    option = {
        "cf2_upgrade": "CONFIG_CRAZYFLIE_THRUST_UPGRADE_KIT=y",
        "cf2_plus": "CONFIG_CRAZYFLIE_21_PLUS=y",
        "cf2_legacy": "CONFIG_CRAZYFLIE_LEGACY_PROPELLERS=y",
        "cf21bl": "CONFIG_PLATFORM_CF21BL=y",
    }
    page = (REPO / "docs" / "FIRMWARE.md").read_text(encoding="utf-8")
    assert {path.name for path in (FIRMWARE / "configs").iterdir()} == {f"{name}_defconfig" for name in option}
    for name, line in option.items():
        config = tmp_path / "repo" / "firmware" / "configs" / f"{name}_defconfig"
        done = made(tmp_path, config.name)
        assert done.returncode == 0, done.stderr
        assert done.stdout.splitlines()[-1] == f"chose {tmp_path}/repo/firmware/build {config}"
        assert line in config.read_text(encoding="utf-8").splitlines()
        assert f"`make -C firmware {config.name}`" in page


def test_motors_are_never_chosen_silently(tmp_path: Path) -> None:
    done = made(tmp_path)
    assert done.returncode != 0
    assert "choose the motors first, one of: " in done.stderr
    assert "cf2_upgrade_defconfig" in done.stderr
    done = made(tmp_path, "cf2_defconfig")
    assert done.returncode != 0
    assert "cf2_defconfig does not say which motors: cf2_legacy_defconfig cf2_plus_defconfig" in done.stderr


def test_the_build_has_a_number_that_follows_the_sources(tmp_path: Path) -> None:
    def number() -> str:
        assert made(tmp_path, "cf2_plus_defconfig").returncode == 0
        with (tmp_path / "crazyflie-firmware" / "tools" / "make" / "oot.mk").open("a") as sdk:
            sdk.write("number_config:\n\t@echo $(IVL_BUILD)\n")
        return made(tmp_path, "number_config").stdout.strip()

    first = number()
    assert re.fullmatch(r"[0-9a-f]{8}", first)
    assert number() == first
    with (tmp_path / "repo" / "firmware" / "core" / "ivl_math.h").open("a") as source:
        source.write("// another one\n")
    assert number() != first
    assert "-DIVL_BUILD=0x$(IVL_BUILD)" in (FIRMWARE / "app" / "Kbuild").read_text(encoding="utf-8")
