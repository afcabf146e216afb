"""A part of a page that a program writes: what stands between two marks; all else is written by hand."""

import difflib
from pathlib import Path


def replace(text: str, new: str, begin: str, end: str) -> str:
    """The page's text with a new part between the marks.

    Raises:
        ValueError: The marks are not there, once each and in order.
    """
    if text.count(begin) != 1 or text.count(end) != 1 or text.index(begin) > text.index(end):
        raise ValueError(f"expected {begin} and, after it, {end}, once each")
    head, tail = text[: text.index(begin) + len(begin)], text[text.index(end) :]
    return f"{head}\n\n{new.strip()}\n\n{tail}"


def write(page: Path, new: str, begin: str, end: str) -> int:
    """Put a new part between the marks; the exit code 0."""
    page.write_text(replace(page.read_text(encoding="utf-8"), new, begin, end), encoding="utf-8")
    return 0


def check(page: Path, new: str, begin: str, end: str, source: Path) -> int:
    """Say whether `write` would change the page; the exit code 1 if it would."""
    old = page.read_text(encoding="utf-8")
    wanted = replace(old, new, begin, end)
    changes = difflib.unified_diff(old.splitlines(), wanted.splitlines(), str(page), "from the data", lineterm="")
    different = list(changes)
    print("\n".join(different[:60]) if different else f"{page.name}: equal to what {source} gives")
    return 1 if different else 0
