"""All pictures of a policy for every approach."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ivl.plots import policy_flow_space, policy_go, policy_rates, policy_surface, style
from ivl.policy.survey import Survey


@dataclass(frozen=True)
class Picture:
    """One picture: its name, its title for people, and who draws it."""

    name: str
    title: str
    draw: Callable[[Survey, Sequence[Path], int], list[Path]]


def _surface(found: Survey, paths: Sequence[Path], dpi: int) -> list[Path]:
    return policy_surface.draw(found.general, found.theta, paths, dpi)


PICTURES = (
    Picture(policy_surface.NAME, "Threshold and probability over the sensed velocities", _surface),
    Picture(policy_rates.NAME, "Landing rate of three policies", policy_rates.draw),
    Picture(policy_flow_space.NAME, "Approaches in the augmented flow space", policy_flow_space.draw),
    Picture(policy_go.NAME, "Go / no-go: estimate and outcome", policy_go.draw),
)


def draw_all(found: Survey, folder: Path, suffixes: Sequence[str], dpi: int = style.DPI) -> list[Path]:
    """Draw every picture into a folder, which is made if it is not there; each in every format.

    Raises:
        ConfigError: A file cannot be written.
    """
    style.make_folder(folder)
    files: list[Path] = []
    for picture in PICTURES:
        files += picture.draw(found, [folder / f"{picture.name}{suffix}" for suffix in suffixes], dpi)
    return files
