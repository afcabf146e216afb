"""What the policies for every approach cost on the STM32F405: the flight core compiled with and without them.

    .venv/bin/python tools/stm32/parts.py

Flash (gcc -Os, all objects): with all, without the forms for every approach, without go / no-go and level-out, without
both. Instructions: worst tick of an approach over recorded ticks. Each form has recordings of its own, the same but for
the policies, and `constant` is the measure; the core without go / no-go and level-out gets those of `constant`. Such a
core is compiled in a temporary copy, never flown: its parameters stay, and its level-out does nothing.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import budget
import objects
import recording

ROOT = Path(__file__).parents[2]
_BUILD = Path("build") / budget.VEHICLE_BUILD
_COPIED = ("firmware", "tools")
_N_TICKS, _SEED = 200_000, 20
_FORMS = ("polynomial2", "polynomial3", "bilinear")
_NO_LEVEL_OUT = """#include "ivl_level_out.h"
float ivl_level_out_rise_m(const ivl_cfg_t *cfg, float v_close_mps, float thrust_mps2)
{
    (void)cfg, (void)v_close_mps, (void)thrust_mps2;
    return 0.0f;
}
void ivl_level_out_prepare(ivl_state_t *state)
{
    (void)state;
}
void ivl_level_out_ask(const ivl_cfg_t *cfg, ivl_state_t *state, const ivl_seen_t *seen)
{
    (void)cfg, (void)state, (void)seen;
}
ivl_reference_t ivl_level_out_next(const ivl_cfg_t *cfg, ivl_state_t *state)
{
    (void)cfg;
    return (ivl_reference_t){.p_W_m = state->p_hold_W_m};
}
bool ivl_level_out_rests(const ivl_state_t *state)
{
    (void)state;
    return true;
}
"""


def main() -> int:
    """Print both tables."""
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        built = {
            name: _built(work / name.replace(" ", "-"), forms, level_out)
            for name, forms, level_out in (
                ("all", True, True), ("no forms", False, True), ("no level-out", True, False), ("neither", False, False)
            )
        }  # fmt: skip
        flash = {name: objects.flash_bytes(sorted((b / "firmware" / "core").glob("*.o"))) for name, b in built.items()}
        for name in flash:
            print(f"flash, {name:14} {flash[name]:6} B  {flash['all'] - flash[name]:+6} B for the rest", flush=True)
        counted = {name: _worst(built["all"], name, work) for name in ("constant", *_FORMS)}
        counted["no level-out"] = _worst(built["no level-out"], "constant", work)
        for name, most in counted.items():
            print(f"worst tick of an approach, {name:14} {most:5}  {most - counted['constant']:+5}", flush=True)
    return 0


def _built(folder: Path, forms: bool, level_out: bool) -> Path:
    """Build folder of a copy of the firmware with what is asked for.

    Raises:
        RuntimeError: Something to be taken out is not where it was.
    """
    for name in _COPIED:
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    core = folder / "firmware" / "core"
    if not forms:
        for name in _FORMS:
            _take_out(core / "ivl_form.h", f"    X({name})")
            (core / f"ivl_form_{name}.c").unlink()
        (core / "ivl_general.c").unlink()
    if not level_out:
        (core / "ivl_level_out.c").write_text(_NO_LEVEL_OUT, encoding="utf-8")
    command = ["make", "--no-print-directory", "-f", "tools/stm32.mk", f"FLAVOUR={budget.VEHICLE_BUILD}"]
    subprocess.run([*command, "core", f"{_BUILD}/replay.elf"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    return folder / _BUILD


def _take_out(path: Path, text: str) -> None:
    """Take a row out of a list of rows; the backslash behind it goes, too."""
    lines = path.read_text(encoding="utf-8").splitlines()
    kept = [line for line in lines if not line.startswith(text)]
    if len(kept) != len(lines) - 1:
        raise RuntimeError(f"{path.name}: no row {text.strip()}")
    path.write_text("\n".join(kept) + "\n", encoding="utf-8")


def _worst(build: Path, form: str, work: Path) -> int:
    """Most instructions of a tick of an approach."""
    folder = work / f"recorded-{form}"
    folder.mkdir(exist_ok=True)
    recorded = recording.record(folder, _N_TICKS, _SEED, form=form)
    return budget._counts(build / "replay.elf", recorded)["approach"][3]


if __name__ == "__main__":
    sys.exit(main())
