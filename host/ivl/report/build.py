"""From a run folder, or a policy, to a page."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ivl import files
from ivl.errors import ConfigError, StoreError
from ivl.policy.assess import Assessment
from ivl.policy.file import PolicyFile
from ivl.policy.survey import Survey
from ivl.report import learn_page, page
from ivl.report.landings import Album
from ivl.store import read_manifest

N_LANDINGS_MAX = 1500
"""So many landings keep a page below 8 MB: each is about 1.4 kB, plotly 2 MB, the tables of a full campaign 2 MB."""


@dataclass(frozen=True)
class Report:
    """A page that was written.

    Attributes:
        path: The file.
        size_bytes: Its size.
        n_landings: Landings that it can replay.
        n_different: Of these, landings that did not come out as the run recorded them.
    """

    path: Path
    size_bytes: int
    n_landings: int
    n_different: int


def write(
    folder: Path,
    out: Path | None = None,
    n_landings_max: int = N_LANDINGS_MAX,
    on_landing: Callable[[int, int], None] = lambda _done, _all: None,
) -> Report:
    """Write the page of a run.

    Args:
        folder: Run folder of `ivl learn` or `ivl sweep`.
        out: File to write; `report.html` in the folder if omitted.
        n_landings_max: Most landings that the page carries.
        on_landing: Progress: (done, all) after each landing.

    Raises:
        StoreError: The folder holds no run that can be read.
        ConfigError: The file cannot be written.
    """
    data, album = _collector(folder)(folder, n_landings_max, on_landing)
    return _save(data, album, out or folder / "report.html")


def write_policy(policy: PolicyFile, name: str, found: Survey, judged: Assessment, out: Path) -> Report:
    """Write the page of a policy for every approach.

    Args:
        policy: The policy.
        name: What the page calls it.
        found: Flights of its pictures.
        judged: Its numbers.
        out: File to write.

    Raises:
        ConfigError: The file cannot be written.
    """
    from ivl.report import policy_page  # matplotlib takes a second to load

    return _save(*policy_page.collect(policy, name, found, judged), out)


def _save(data: dict[str, Any], album: Album, path: Path) -> Report:
    text = page.render(data)
    try:
        files.write(path, text)
    except OSError as error:
        raise ConfigError(f"{path}: the report cannot be written: {files.reason(error)}") from error
    return Report(path, path.stat().st_size, len(album.landings), album.n_different)


def _collector(folder: Path) -> Callable[[Path, int, Callable[[int, int], None]], tuple[dict[str, Any], Album]]:
    """What gathers the data of this kind of run; a run of `ivl learn` needs no pandas."""
    manifest = read_manifest(folder)
    if "map" in manifest:
        raise StoreError(f"{folder}: is a policy map; a report is made of a run of `ivl learn` or `ivl sweep`")
    if "sweep" not in manifest:
        return learn_page.collect
    from ivl.report import sweep_page

    return sweep_page.collect
