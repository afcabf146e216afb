"""Fixtures shared by the tests of the links. The package is imported before numpy, which it sets up."""

import sys
from pathlib import Path

import ivl  # noqa: F401

sys.path.insert(0, str(Path(__file__).parent))
