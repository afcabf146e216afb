r"""Check that every equation and section of docs/MODEL.md that is quoted somewhere exists there.

A quotation reads `[MODEL eq. 4.2]`, `[MODEL eq. 8.2, 8.3]`, `[MODEL eq. 4.9 - 4.12]` or `[MODEL sec. 4]`, also in round
brackets and with more text behind.  The document numbers an equation by `(4.2)` or `\tag{4.2}` at the end of its line,
and a section by its heading, `## 4. Title`.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
MODEL = ROOT / "docs" / "MODEL.md"
FOLDERS = ("firmware", "sim_sil", "host", "tests", "docs")
SUFFIXES = {".c", ".h", ".py", ".yaml", ".md"}

EQUATION = re.compile(r"(?:\((\d+\.\d+[a-z]?)\)|\\tag\{(\d+\.\d+[a-z]?)\})\W*$", re.MULTILINE)
SECTION = re.compile(r"^#+\s+(\d+(?:\.\d+)*)\.?\s", re.MULTILINE)
NUMBERS = r"\d+(?:\.\d+)*[a-z]?(?:(?:\s*,\s*|\s+and\s+|\s*-\s*|\s+to\s+|\s*\u2013\s*)\d+(?:\.\d+)*[a-z]?)*"
QUOTATION = re.compile(rf"\bMODEL(?:\.md)?,?\s+(eqs?|secs?)\.?\s+({NUMBERS})")


def main() -> int:
    """Print every quotation that leads nowhere; return 1 if there is one."""
    text = MODEL.read_text(encoding="utf-8")
    known = {
        "eq": {plain or tagged for plain, tagged in EQUATION.findall(text)},
        "sec": set(SECTION.findall(text)),
    }
    quoted, lost = 0, 0
    files = (path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*")) if path.suffix in SUFFIXES)
    for path in files:
        content = path.read_text(encoding="utf-8")
        for match in QUOTATION.finditer(content):
            kind = match[1].rstrip("s")
            line = content.count("\n", 0, match.start()) + 1
            for number in re.findall(r"\d+(?:\.\d+)*[a-z]?", match[2]):
                quoted += 1
                if number not in known[kind]:
                    lost += 1
                    place = f"{path.relative_to(ROOT)}:{line}"
                    print(f"error: {place}: docs/MODEL.md has no {kind}. {number}", file=sys.stderr)
    print(f"  {quoted} quotations of {len(known['eq'])} equations, {len(known['sec'])} sections; {lost} lead nowhere")
    return 1 if lost or not quoted or not known["eq"] else 0


if __name__ == "__main__":
    sys.exit(main())
