"""The makers of web pages and notebook: what they refuse, and that no page and no command is left out."""

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest
import typer.main

from ivl import cli, native, template
from ivl.experiment import Experiment

ROOT = Path(__file__).parents[2]


def tool(path: str, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """A program of tools/ as a module, which finds those beside it."""
    file = ROOT / "tools" / path
    monkeypatch.syspath_prepend(str(file.parent))
    spec = importlib.util.spec_from_file_location(f"tool_{file.stem}", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_links_out_of_the_pages_lead_to_files_that_exist(monkeypatch: pytest.MonkeyPatch) -> None:
    build = tool("docs/build.py", monkeypatch)
    assert build.without_links_out("see [ivl.h](../firmware/core/ivl.h).", "X.md") == "see `firmware/core/ivl.h`."
    assert build.without_links_out("[the core](../firmware/core)", "X.md") == "the core (`firmware/core`)"
    with pytest.raises(SystemExit, match=r"X\.md: there is no firmware/core/none\.h"):
        build.without_links_out("[none.h](../firmware/core/none.h)", "X.md")


def test_every_page_is_in_one_section_of_the_index(monkeypatch: pytest.MonkeyPatch) -> None:
    build = tool("docs/build.py", monkeypatch)
    index = (ROOT / "docs" / "README.md").read_text(encoding="utf-8")
    pages = {path.stem for path in (ROOT / "docs").glob("*.md")} - {"README"}
    linked = re.findall(r"^(\w+)$", build.with_contents(index).split("```{toctree}", 1)[1], re.MULTILINE)
    assert sorted(linked) == sorted(pages)
    with pytest.raises(SystemExit, match="linked from two sections: HOST"):
        build.with_contents("# A\n\n## B\n\n[HOST](HOST.md)\n\n## C\n\n[HOST](HOST.md)\n")


def test_the_reference_has_every_command_field_and_number(monkeypatch: pytest.MonkeyPatch) -> None:
    made = tool("docs/generated.py", monkeypatch).pages()
    top = typer.main.get_command(cli.app).commands
    assert {line.split()[2] for line in re.findall(r"^## ivl .+$", made["COMMANDS.md"], re.MULTILINE)} == set(top)
    experiment = made["FILES.md"].split("## A file of the kind experiment", 1)[1].split("\n### ", 1)[0]
    assert re.findall(r"^\| `(\w+)`", experiment, re.MULTILINE) == list(Experiment.model_fields)
    assert [kind for kind in template.kinds() if f"of the kind {kind}\n" not in made["FILES.md"]] == []
    names = [*native.library().params, *native.library().outcome_fields, *native.library().trace_fields]
    assert [name for name in names if f"| `{name}` |" not in made["NUMBERS.md"]] == []
    assert len(re.findall(r"^\| `[\w.]+` \|", made["NUMBERS.md"], re.MULTILINE)) > len(names)


def test_a_page_becomes_cells_and_a_cell_that_fails_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    notebook = tool("notebook.py", monkeypatch)
    made = notebook.from_page("# A\n\nSee [HOST](HOST.md) and [one](../examples/one.py).\n\n```python\n1 / 0\n```\n")
    assert [cell.cell_type for cell in made.cells] == ["markdown", "code"]
    assert made.cells[0].source.endswith("See [HOST](../docs/HOST.md) and [one](one.py).")
    with pytest.raises(notebook.nbclient.exceptions.CellExecutionError, match="ZeroDivisionError"):
        notebook.run(made)
