"""Packages that only some uses need: imported when they are used, with a hint where they are missing."""

import importlib
from typing import Any

from ivl.errors import MissingError

EXTRAS = {
    "pyarrow": "sweep", "pandas": "sweep", "xarray": "sweep", "dask": "sweep", "distributed": "sweep",
    "cryptography": "sweep", "dask_jobqueue": "cluster", "plotly": "report", "mcap": "report", "rerun": "rerun",
    "tornado": "live", "foxglove": "live", "cflib": "link", "cantools": "link", "can": "link", "gymnasium": "gym",
    "imageio_ffmpeg": "video",
}  # fmt: skip
"""Packages of extras, and the extra that brings each, for commands that cannot do without."""


def hint(error: ModuleNotFoundError) -> str | None:
    """What installs a module that was not found; None if no extra does."""
    extra = EXTRAS.get((error.name or "").partition(".")[0])
    return None if extra is None else f"{error.name} is not installed: pip install 'ivl[{extra}]'"


def needed(module: str, extra: str) -> Any:
    """A module of a package that need not be installed.

    Args:
        module: Its name.
        extra: The extra of this package that brings it.

    Raises:
        MissingError: It is not installed; the message says how to install it.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] != module.partition(".")[0]:
            raise  # the package is there, and lacks something itself
        raise MissingError(f"{error.name} is not installed: pip install 'ivl[{extra}]'") from error
