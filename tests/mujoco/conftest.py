"""The modules of this folder import each other by plain name, from pytest as from the command line."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
