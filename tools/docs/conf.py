"""Configuration of Sphinx for the documentation; tools/docs/build.py prepares the sources and calls it."""

from typing import Any

import numpy as np
import numpy.typing as npt
from sphinx.application import Sphinx
from sphinx.util.typing import stringify_annotation

import ivl

project = "Inverted Landing"
author = "Inverted Landing contributors"
copyright = author  # noqa: A001 - Sphinx reads this name
release = version = ivl.__version__
root_doc = "README"

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_heading_anchors = 4
myst_enable_extensions = ["fieldlist"]

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
napoleon_google_docstring = True
napoleon_numpy_docstring = False

html_theme = "furo"
html_title = "Inverted Landing"
html_show_sphinx = False
html_copy_source = False
highlight_language = "none"
default_role = "code"

# types that would be spelled out over many lines, and what people call them
SHORT = {
    stringify_annotation(kind, mode): name
    for mode in ("smart", "fully-qualified-except-typing")
    for kind, name in (
        (npt.ArrayLike, "ArrayLike"),
        (npt.NDArray[np.float64], "NDArray[float64]"),
        (npt.NDArray[np.float32], "NDArray[float32]"),
        (npt.NDArray[np.bool_], "NDArray[bool]"),
        (npt.NDArray[Any], "NDArray"),
    )
}


def shorten(
    _app: Sphinx, _what: str, _name: str, _object: Any, _options: Any, signature: str | None, returned: str | None
) -> tuple[str | None, str | None]:
    """Write types of numpy by their short names."""
    for long, short in SHORT.items():
        signature = signature and signature.replace(long, short)
        returned = returned and returned.replace(long, short)
    return signature, returned


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    app.connect("autodoc-process-signature", shorten)
