"""Build the documentation as web pages: the pages of docs/, and the reference that is generated from the package.

    .venv/bin/python tools/docs/build.py                # into build/docs/html
    .venv/bin/python tools/docs/build.py --out folder

It needs no network. Warnings of Sphinx are errors: a link that leads nowhere, a heading out of order, a docstring that
cannot be parsed. Links out of docs/ lead to files of the repository, which the pages do not carry: they become names of
files, and each of these files must exist.
"""

import argparse
import os
import re
import shutil
import sys
from pathlib import Path

import generated
from sphinx.cmd.build import build_main

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
INDEX = "README.md"
REFERENCE = """
## Reference

- [COMMANDS](COMMANDS.md): the help of every command
- [FILES](FILES.md): every field of every kind of file
- [NUMBERS](NUMBERS.md): parameters of a world, fields of an outcome, columns of a trace
- [API](API.md): classes and functions of the package
"""
OUTSIDE = re.compile(r"\[([^\]]+)\]\(\.\./([^)#\s]+)(?:#[^)]*)?\)")


def without_links_out(text: str, page: str) -> str:
    """Turn each link to a file outside docs/ into the name of the file.

    Raises:
        SystemExit: The file does not exist.
    """

    def named(match: re.Match[str]) -> str:
        target = match[2]
        if target == INDEX:
            return match[1]
        if not (ROOT / target).exists():
            sys.exit(f"docs: {page}: there is no {target}")
        return f"`{target}`" if match[1].strip("`") in target else f"{match[1]} (`{target}`)"

    return OUTSIDE.sub(named, text)


def with_contents(index: str) -> str:
    """The index, and for each of its sections a table of contents in the order of its links.

    Raises:
        SystemExit: A page is linked twice, or not at all.
    """
    parts = re.split(r"^## (.+)$", index, flags=re.MULTILINE)
    trees, seen = [], []
    for heading, body in zip(parts[1::2], parts[2::2], strict=True):
        pages = list(dict.fromkeys(re.findall(r"\]\((\w+)\.md\)", body)))
        if pages:
            trees.append("\n".join(["```{toctree}", ":hidden:", f":caption: {heading}", "", *pages, "```"]))
        seen += pages
    twice = {page for page in seen if seen.count(page) > 1}
    if twice:
        sys.exit(f"docs: {INDEX}: linked from two sections: {', '.join(sorted(twice))}")
    return index + "\n\n" + "\n\n".join(trees) + "\n"


def prepare(source: Path) -> None:
    """Write the sources that Sphinx reads: pages, pictures and the generated reference."""
    shutil.rmtree(source, ignore_errors=True)
    shutil.copytree(ROOT / "docs" / "figures", source / "figures")
    for program in (ROOT / "docs").glob("*.py"):
        shutil.copy(program, source)
    for page in sorted((ROOT / "docs").glob("*.md")):
        text = without_links_out(page.read_text(encoding="utf-8"), page.name)
        if page.name == INDEX:
            text = with_contents(text + REFERENCE)
        (source / page.name).write_text(text, encoding="utf-8")
    for name, text in generated.pages().items():
        (source / name).write_text(text, encoding="utf-8")
    shutil.copy(HERE / "API.md", source)


def main() -> int:
    """Prepare the sources and call Sphinx."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "docs", help="folder; pages are in its html/")
    args = parser.parse_args()
    os.chdir(ROOT)
    source = args.out / "source"
    prepare(source)
    shutil.rmtree(args.out / "html", ignore_errors=True)
    flags = ["-b", "html", "-W", "--keep-going", "-q", "-c", str(HERE), "-d", str(args.out / "doctrees")]
    code = build_main([*flags, str(source), str(args.out / "html")])
    if code == 0:
        print(f"{args.out / 'html' / 'README.html'}")
    return code


if __name__ == "__main__":
    sys.exit(main())
