"""Figures, one per file; each `draw` function takes data and paths and returns the files it wrote."""

import os


def _import_matplotlib() -> None:
    """Import matplotlib whatever window system a user's environment names: pictures here have none."""
    chosen = os.environ.get("MPLBACKEND")
    os.environ["MPLBACKEND"] = "agg"  # a notebook names one that need not be installed, which would end the import
    try:
        import matplotlib  # noqa: F401
    finally:
        if chosen is None:
            del os.environ["MPLBACKEND"]
        else:
            os.environ["MPLBACKEND"] = chosen


_import_matplotlib()
