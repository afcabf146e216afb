"""Sweeps: conditions x gears x trials as tasks on this machine's cores or a cluster, and the tables they leave.

The package can be called: `ivl.sweep(...)` is `ivl.api.sweep`. Importing a module of a package gives the package's name
to its parent, so a function `ivl.sweep` would be replaced by this package as soon as somebody imported a part of it.
"""

import sys
from types import ModuleType
from typing import Any


class _Callable(ModuleType):
    """A module that can be called."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        """As `ivl.api.sweep`."""
        from ivl.api import sweep  # uses modules of this package

        return sweep(*arguments, **options)


sys.modules[__name__].__class__ = _Callable
