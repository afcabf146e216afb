"""Write docs/PARAMS.md from the tables of firmware/core/ivl_vars.h; with --check say whether the page is up to date.

The C compiler expands the tables (tools/vars.c), so that the page cannot read them differently from the firmware.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "PARAMS.md"
HEAD = """\
# Parameters and logs of the flight core

Printed by `python tools/params.py` from [firmware/core/ivl_vars.h](../firmware/core/ivl_vars.h), the one table that the
drone, the software vehicle and the host share. A parameter outside its range, or no number, is refused, and with it the
whole commit ([FIRMWARE](FIRMWARE.md)). Unit 1: dimensionless.
"""
PARAM_HEAD = "## Parameters\n\n| parameter | type | unit | from | to | default | |\n|---|---|---|---|---|---|---|"
LOG_HEAD = "## Logs\n\n| log | type | unit | |\n|---|---|---|---|"
TYPES = {"float": "float", "uint8_t": "u8", "uint16_t": "u16", "uint32_t": "u32", "int8_t": "i8"}


def rows() -> list[list[str]]:
    """Compile and run tools/vars.c; one list of fields per row."""
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "vars"
        command = [os.environ.get("CC", "cc"), f"-I{ROOT / 'firmware' / 'core'}", str(ROOT / "tools" / "vars.c")]
        subprocess.run([*command, "-o", str(program)], check=True)
        out = subprocess.run([str(program)], check=True, capture_output=True, text=True).stdout
    return [line.split("\t") for line in out.splitlines()]


def page() -> str:
    """The whole text."""
    params = [PARAM_HEAD]
    logs = [LOG_HEAD]
    for kind, ctype, name, unit, low, high, default, text in rows():
        if kind == "param":
            params.append(f"| `{name}` | {TYPES[ctype]} | {unit} | {low} | {high} | {default} | {text} |")
        else:
            logs.append(f"| `{name}` | {TYPES[ctype]} | {unit} | {text} |")
    return "\n".join([HEAD, *params, "", *logs, ""])


def main() -> int:
    """Write or check the page."""
    if "--check" not in sys.argv:
        PAGE.write_text(page(), encoding="utf-8")
    elif PAGE.read_text(encoding="utf-8") != page():
        print("docs/PARAMS.md is not what firmware/core/ivl_vars.h gives: run python tools/params.py", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
