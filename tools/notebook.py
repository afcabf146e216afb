"""Make the notebook of docs/TUTORIAL.md, and run it.

    .venv/bin/python tools/notebook.py            # write examples/tutorial.ipynb, and run it into build/notebook
    .venv/bin/python tools/notebook.py --check    # run it; fail if examples/tutorial.ipynb is not what the page gives

A block of Python on the page is a cell. The notebook in examples/ has no outputs, so that a change of it can be read;
that in build/notebook has text and figures. A cell that raises an error ends this program.
"""

import argparse
import re
import sys
import tempfile
from pathlib import Path

import jupytext
import nbclient
import nbformat

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "TUTORIAL.md"
NOTEBOOK = ROOT / "examples" / "tutorial.ipynb"
RUN = ROOT / "build" / "notebook" / "tutorial.ipynb"
KERNEL = {"display_name": "Python 3", "language": "python", "name": "python3"}
CELL_MAX_S = 600  # a cell that does not end; no measure of speed


def from_page(text: str) -> nbformat.NotebookNode:
    """The notebook of a page; links of the page lead from examples/ to docs/."""
    made = jupytext.reads(text, fmt="md:markdown")
    made.metadata = nbformat.from_dict({"kernelspec": KERNEL, "language_info": {"name": "python"}})
    for number, cell in enumerate(made.cells):
        cell.id = f"cell-{number}"  # those of jupytext are drawn anew each time
        cell.metadata = nbformat.from_dict({})
        if cell.cell_type == "markdown":
            cell.source = re.sub(r"\]\((\w+\.md)\)", r"](../docs/\1)", cell.source.replace("](../examples/", "]("))
    return made


def run(notebook: nbformat.NotebookNode) -> int:
    """Run the cells in an empty folder, and return how many figures they drew."""
    with tempfile.TemporaryDirectory(prefix="ivl-notebook-") as folder:
        client = nbclient.NotebookClient(notebook, timeout=CELL_MAX_S, resources={"metadata": {"path": folder}})
        client.execute()
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    return sum("image/png" in output.get("data", {}) for output in outputs)


def main() -> None:
    """Make, compare or run it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="compare and run, and write nothing in examples/")
    args = parser.parse_args()
    made = from_page(PAGE.read_text(encoding="utf-8"))
    text = nbformat.writes(made) + "\n"
    if not args.check:
        NOTEBOOK.write_text(text, encoding="utf-8")
    elif not NOTEBOOK.exists() or NOTEBOOK.read_text(encoding="utf-8") != text:
        sys.exit(f"notebook: {NOTEBOOK} is not what {PAGE} gives: run tools/notebook.py")
    n_figures = run(made)
    if n_figures != PAGE.read_text(encoding="utf-8").count("plt.show()"):
        sys.exit(f"notebook: {n_figures} figures were drawn, which are not as many as the page shows")
    RUN.parent.mkdir(parents=True, exist_ok=True)
    nbformat.write(made, RUN)
    print(f"{RUN}: {n_figures} figures")


if __name__ == "__main__":
    main()
