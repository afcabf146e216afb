"""Write docs/PARAMS.md from the tables of firmware/core/ivl_vars.h; with --check say whether the page is up to date.

The C compiler expands the tables (tools/vars.c), so that the page cannot read them differently from the firmware.
"""

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "PARAMS.md"
HEAD = """\
# Parameters and logs of the flight core

Printed by `python tools/params.py` from [firmware/core/ivl_vars.h](../firmware/core/ivl_vars.h), the one table that the
drone, the software vehicle and the host share, and from the rows that the app adds to it
([firmware/app/app_vars.c](../firmware/app/app_vars.c)). A parameter outside its range, or no number, is refused, and
with it the whole commit ([FIRMWARE](FIRMWARE.md)). Unit 1: dimensionless.
"""
PARAM_HEAD = "## Parameters\n\n| parameter | type | unit | from | to | default | |\n|---|---|---|---|---|---|---|"
LOG_HEAD = "## Logs\n\n| log | type | unit | |\n|---|---|---|---|"
APP_HEAD = "## What the app adds\n\n| name | | type | |\n|---|---|---|---|"
TYPES = {"float": "float", "uint8_t": "u8", "uint16_t": "u16", "uint32_t": "u32", "int8_t": "i8"}


def rows() -> list[list[str]]:
    """Compile and run tools/vars.c; one list of fields per row."""
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "vars"
        command = [os.environ.get("CC", "cc"), f"-I{ROOT / 'firmware' / 'core'}", str(ROOT / "tools" / "vars.c")]
        subprocess.run([*command, "-o", str(program)], check=True)
        out = subprocess.run([str(program)], check=True, capture_output=True, text=True).stdout
    return [line.split("\t") for line in out.splitlines()]


def app_rows() -> list[str]:
    """Lines of the table for what the app adds, from its macros and the comments before them."""
    text = (ROOT / "firmware" / "app" / "app_vars.c").read_text(encoding="utf-8")
    row = r"/\*\*\s+\* @brief (.*?)\s*\*/\s+(PARAM|LOG)_ADD\w*\(\w+_(U?INT)(\d+)( \| PARAM_RONLY)?, (\w+),"
    found = re.findall(row, text, re.DOTALL)
    if len(found) != len(re.findall(r"^(?:PARAM|LOG)_ADD", text, re.MULTILINE)):
        raise ValueError("firmware/app/app_vars.c: a row has no comment, or is none that this tool reads")
    return [
        f"| `ivl.{name}` | {kind.lower()}{', read-only' if read_only else ''} | "
        f"{number.replace('UINT', 'u').replace('INT', 'i')}{bits} | {' '.join(doc.replace('*', ' ').split())} |"
        for doc, kind, number, bits, read_only, name in found
    ]


def page() -> str:
    """The whole text."""
    params = [PARAM_HEAD]
    logs = [LOG_HEAD]
    for kind, ctype, name, unit, low, high, default, text in rows():
        if kind == "param":
            params.append(f"| `{name}` | {TYPES[ctype]} | {unit} | {low} | {high} | {default} | {text} |")
        else:
            logs.append(f"| `{name}` | {TYPES[ctype]} | {unit} | {text} |")
    return "\n".join([HEAD, *params, "", *logs, "", APP_HEAD, *app_rows(), ""])


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
