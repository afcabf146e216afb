"""docs/GLOSSARY.md: in order, one meaning a word, in a sentence or two, and the file that is named knows the word."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROWS = re.findall(
    r"^\| ([^|]+) \| ([^|]+) \| `([^`|]+)` \| ([^|]+) \|$",
    (ROOT / "docs" / "GLOSSARY.md").read_text(encoding="utf-8"),
    re.MULTILINE,
)
WORDS = [row[0] for row in ROWS]


def plain(text: str) -> str:
    """Lower case, without what joins the parts of a word."""
    return re.sub(r"[\s_-]", "", text.lower())


def test_every_line_of_the_table_is_an_entry() -> None:
    lines = [line for line in (ROOT / "docs" / "GLOSSARY.md").read_text(encoding="utf-8").splitlines() if "|" in line]
    assert len(ROWS) == len(lines) - 2
    assert {"task", "policy", "form", "site", "episode", "run", "campaign"} <= set(WORDS)


def test_words_are_in_order_and_each_stands_once() -> None:
    assert sorted(WORDS, key=str.lower) == WORDS
    assert len(set(map(str.lower, WORDS))) == len(WORDS)


@pytest.mark.parametrize(("word", "meaning", "path", "other"), ROWS, ids=WORDS)
def test_an_entry_is_a_sentence_or_two_and_its_file_knows_the_word(
    word: str, meaning: str, path: str, other: str
) -> None:
    assert re.fullmatch(r"[A-Z][^.!?]*\.( [A-Z][^.!?]*\.)?", meaning)
    assert word not in re.split(r"[;,] ", other)
    assert (ROOT / path).is_file()
    assert plain(word) in plain(path + (ROOT / path).read_text(encoding="utf-8"))


def test_readme_and_design_lead_there() -> None:
    assert "(docs/GLOSSARY.md)" in (ROOT / "README.md").read_text(encoding="utf-8")
    assert "(GLOSSARY.md)" in (ROOT / "docs" / "DESIGN.md").read_text(encoding="utf-8")
