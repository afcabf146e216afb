"""The test forms of this folder in library, software vehicle and image of the chip, for a session of their own.

The library is loaded once a process, so these tests run alone (`make test-forms`), with the builds named before `ivl`
is imported.
"""

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from form_six import BUILDS, ROOT, SIX

os.environ.update({name: str(path) for name, path in BUILDS.items()})

import ivl  # isort: split

from ivl import experiment, native
from ivl.experiment import Experiment

sys.path.insert(0, str(ROOT / "tests" / "sweep"))
assert ivl.__version__


@pytest.fixture(autouse=True, scope="session")
def _own_builds(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Whatever another session has loaded before is not what is tested here."""
    missing = [str(path) for path in BUILDS.values() if not path.is_file()]
    assert not missing, f"{missing[0]} is missing: run the tests by `make test-forms`, which compiles it"
    assert native.library().path == BUILDS["IVL_NATIVE_LIBRARY"], "these tests need a process of their own"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="session")
def six() -> Experiment:
    """The form of six parameters, learned and judged within a second."""
    return experiment.from_data(SIX, "six.yaml")


@pytest.fixture
def six_file(six: Experiment, tmp_path: Path) -> Path:
    path = tmp_path / "six.yaml"
    path.write_text(six.to_yaml())
    return path
