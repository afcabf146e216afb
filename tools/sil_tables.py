"""Write docs/SIL_TABLES.md from what the software vehicle serves; with --check say whether the page is up to date.

The program `ivl_sil --tables` prints its own tables (sim_sil/cf/cf_names.h): the page cannot list anything else.
"""

import subprocess
import sys
from pathlib import Path

from ivl.silproc import model_text, server_path
from ivl.world import World

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "SIL_TABLES.md"
VEHICLE = "crazyflie21"
HEAD = """\
# Parameters and logs of the software vehicle

Printed by `python tools/sil_tables.py` from what `ivl sil` serves ([sim_sil/cf/cf_names.h](../sim_sil/cf/cf_names.h)),
without those of the app, group `ivl` ([PARAMS](PARAMS.md)). The names are those of firmware 2026.08, with type, access
and first value, but for the groups `sil`, `simTruth` and `fault` ([SIL](SIL.md)).

**Live**: the simulation changes it, or obeys it. **Held**: it is there because every Crazyflie has it; a held parameter
keeps what is written to it and can be stored, a held log variable stays at one value, and neither changes a flight.
c: a core parameter or variable, kept by the firmware from release to release; p: persistent; r: read-only.
"""
OWN = ("ivl.",)


def rows() -> list[list[str]]:
    """One list of fields per line of the program: kind, name, type, access, persistent, core, live or held, value."""
    command = [str(server_path()), "--model", "-", "--tables"]
    result = subprocess.run(command, input=model_text(World(VEHICLE)), check=True, capture_output=True, text=True)
    fields = [line.split("\t") for line in result.stdout.splitlines()]
    return [row for row in fields if not row[1].startswith(OWN)]


def _listed(kind: str, state: str, table: list[list[str]]) -> list[str]:
    """One line per group."""
    groups: dict[str, list[str]] = {}
    for what, full_name, type_, access, persistent, core, is_live, value in table:
        if (what, is_live) != (kind, state):
            continue
        group, name = full_name.split(".")
        marks = ("c" if core else "") + ("p" if persistent else "") + ("r" if kind == "param" and access == "r" else "")
        text = f"`{name}` {type_}" + (f" {marks}" if marks else "")
        if kind == "param" and state == "held":
            text += f" = {float(value):.6g}"
        groups.setdefault(group, []).append(text)
    return [f"| `{group}` | {', '.join(names)} |" for group, names in groups.items()]


def page() -> str:
    """The whole text."""
    table, parts = rows(), [HEAD]
    for kind, title in (("param", "Parameters"), ("log", "Log variables")):
        for state in ("live", "held"):
            lines = _listed(kind, state, table)
            n = sum(row[0] == kind and row[6] == state for row in table)
            parts.append(f"## {title}, {state} ({n})\n\n| group | |\n|---|---|\n" + "\n".join(lines) + "\n")
    return "\n".join(parts)


def main() -> int:
    """Write or check the page."""
    if "--check" not in sys.argv:
        PAGE.write_text(page(), encoding="utf-8")
    elif PAGE.read_text(encoding="utf-8") != page():
        print("docs/SIL_TABLES.md is not what ivl_sil serves: run python tools/sil_tables.py", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
