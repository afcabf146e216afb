"""Parts of a long measurement that are done, so that one that was ended goes on where it was.

A part counts as long as nothing that it was measured with has changed: each line of the file carries a fingerprint of
that. What is broken is not kept, and is measured again.
"""

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parents[1] / "build" / "kept"
PACKAGE = Path(__file__).parents[1] / "host" / "ivl"


def package() -> list[Path]:
    """The files of the package, what is compiled included."""
    suffixes = {".py", ".yaml", ".so", ".dbc"}
    found = [p for p in PACKAGE.rglob("*") if p.suffix in suffixes or p.name == "ivl_sil"]
    return sorted(p for p in found if p.is_file() and "__pycache__" not in p.parts)


def fingerprint(paths: Iterable[Path]) -> str:
    """Of the contents of files, in this order."""
    digest = hashlib.sha256()
    for path in paths:
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()[:16]


class Kept:
    """Results of parts by name, in a file that only grows."""

    def __init__(self, name: str, rests_on: Iterable[Path]) -> None:
        """Of one kind of measurement, which rests on the contents of these files."""
        self._path, self._of = FOLDER / f"{name}.jsonl", fingerprint(rests_on)
        self._known: dict[str, Any] = {}
        if self._path.exists():
            # the last line may have been cut off with the program
            whole = self._path.read_text(encoding="utf-8").rpartition("\n")[0]
            lines = [json.loads(line) for line in whole.splitlines()]
            self._known = {line["part"]: line["result"] for line in lines if line["of"] == self._of}
            self._path.write_text(whole + "\n" * bool(whole), encoding="utf-8")

    def get(self, part: str) -> Any | None:
        """The result of a part; None if it has to be measured."""
        return self._known.get(part)

    def put(self, part: str, result: Any) -> None:
        """Keep one, plain data."""
        self._known[part] = result
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"of": self._of, "part": part, "result": result}) + "\n")
