"""Write tools/constraints.txt: the versions of every package that the project's own dependencies bring along.

To be run by the Python of a fresh virtual environment into which the project and all its extras were installed without
constraints.  The dependencies themselves are pinned in pyproject.toml and left out, so that each version has one home.
"""

import re
import sys
import tomllib
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).parent.parent
HEADER = """\
# Versions of the packages that the dependencies in pyproject.toml bring along, all extras together.
# Written by tools/lock.py, Python {0.major}.{0.minor}; see there.
"""


def canonical(name: str) -> str:
    """Return the name in the form in which two spellings of a package are equal."""
    return re.sub(r"[-_.]+", "-", name).lower()


def main() -> None:
    """Write the file."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    direct = sum(project["optional-dependencies"].values(), start=project["dependencies"])
    own = {canonical(spec.split("==")[0]) for spec in direct} | {canonical(project["name"]), "pip", "setuptools"}
    found = {canonical(dist.name): dist.version for dist in metadata.distributions()}
    lines = [f"{name}=={version}\n" for name, version in sorted(found.items()) if name not in own]
    (ROOT / "tools" / "constraints.txt").write_text(HEADER.format(sys.version_info) + "".join(lines), encoding="ascii")


if __name__ == "__main__":
    main()
