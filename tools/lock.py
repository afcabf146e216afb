"""Write tools/constraints.txt: the versions of every package that the project uses, its own dependencies among them.

To be run by the Python of a fresh virtual environment into which the project and all its extras were installed without
constraints.  pyproject.toml has the ranges with which the package works, so that each version has one home.
"""

import re
import sys
import tomllib
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).parent.parent
HEADER = """\
# Versions of every package that the project uses, all extras together: with them a run made today can be made again.
# Written by tools/lock.py, Python {0.major}.{0.minor}; see there.
"""


def canonical(name: str) -> str:
    """Return the name in the form in which two spellings of a package are equal."""
    return re.sub(r"[-_.]+", "-", name).lower()


def main() -> None:
    """Write the file."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    own = {canonical(project["name"]), "pip", "setuptools"}
    found = {canonical(dist.name): dist.version for dist in metadata.distributions()}
    lines = [f"{name}=={version}\n" for name, version in sorted(found.items()) if name not in own]
    (ROOT / "tools" / "constraints.txt").write_text(HEADER.format(sys.version_info) + "".join(lines), encoding="ascii")


if __name__ == "__main__":
    main()
