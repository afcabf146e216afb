"""`ivl report` and `ivl export` as people call them."""

import json
import subprocess
import sys
import webbrowser
from pathlib import Path

import pytest

from ivl.cli import run


def test_report_writes_into_the_run_folder_by_default(
    learn_run: Path, learn_page: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["report", str(learn_run)]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert printed.startswith(f"{learn_page}: ")
    assert printed.endswith("MB, 24 landings to replay")


def test_report_tells_scripts_and_opens_a_browser(
    sweep_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda url: opened.append(url) or True)
    page = tmp_path / "page.html"
    assert run(["report", str(sweep_run), "--out", str(page), "--landings", "5", "--open", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == {
        "path": str(page), "size_bytes": page.stat().st_size, "landings": 5, "landings_that_differ": 0,
    }  # fmt: skip
    assert opened == [page.as_uri()]


def test_a_missing_browser_is_said(learn_run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(webbrowser, "open", lambda _url: False)
        assert run(["report", str(learn_run), "--open"]) == 1
    assert "no web browser was found" in " ".join(capsys.readouterr().err.split())


def test_a_policy_map_and_an_empty_folder_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["report", str(tmp_path)]) == 1
    assert "holds no run" in capsys.readouterr().err
    (tmp_path / "manifest.json").write_text(json.dumps({"schema_version": 1, "map": {}}))
    assert run(["report", str(tmp_path)]) == 1
    assert "is a policy map" in capsys.readouterr().err


def test_export_of_a_run_with_layouts(learn_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "best.mcap"
    assert run(["export", str(learn_run), "--out", str(target), "--layouts", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    files = [target, tmp_path / "ivl_foxglove.json", tmp_path / "ivl_plotjuggler.xml"]
    assert told["files"] == [str(file) for file in files]
    assert all(file.stat().st_size > 0 for file in files)


def test_export_of_a_trace_does_not_overwrite_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    trace = tmp_path / "landing.csv"
    landing = ["--speed", "2.5", "--angle", "90", "--rrev", "4.8", "--moment", "8", "--trace", str(trace)]
    assert run(["rollout", *landing]) == 0
    before = trace.read_bytes()
    assert run(["export", str(trace), "--format", "csv"]) == 0
    assert trace.read_bytes() == before
    assert (tmp_path / "landing_bitcraze.csv").read_text().startswith("Timestamp,stateEstimate.x,")
    capsys.readouterr()


@pytest.mark.parametrize("arguments", [["export", "missing"], ["export", "missing.mcap"]])
def test_a_missing_source_is_wrong_usage(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(arguments) == 2
    assert "no such file or run folder" in capsys.readouterr().err


def test_without_mcap_the_message_says_what_to_install(learn_run: Path, tmp_path: Path) -> None:
    program = (
        "import sys; sys.modules['mcap'] = None; sys.modules['mcap.writer'] = None\n"
        "from ivl.cli import run\n"
        f"sys.exit(run(['export', {str(learn_run)!r}, '--out', {str(tmp_path / 'x.mcap')!r}]))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "is not installed: pip install 'ivl[report,sweep]'" in done.stderr
