"""All figures of a campaign in the manner of the paper's, Figs. 4 to 9."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ivl.errors import ConfigError
from ivl.plots import (
    fig04_convergence,
    fig05_state_space,
    fig06_flow_space,
    fig07_augmented_space,
    fig08_moment,
    fig09_gears,
    style,
)
from ivl.plots.campaign import SETUP, Campaign

SUFFIXES = (".pdf", ".png")


@dataclass(frozen=True)
class Figure:
    """One figure: its name, who draws it, and the columns of which it shows a single value."""

    name: str
    draw: Callable[[Campaign, Sequence[Path], int], list[Path]]
    single: tuple[str, ...]


FIGURES = (
    Figure(fig04_convergence.NAME, fig04_convergence.draw, ("vehicle", "gear_set", "gear")),
    Figure(fig05_state_space.NAME, fig05_state_space.draw, SETUP),
    Figure(fig06_flow_space.NAME, fig06_flow_space.draw, SETUP),
    Figure(fig07_augmented_space.NAME, fig07_augmented_space.draw, SETUP),
    Figure(fig08_moment.NAME, fig08_moment.draw, SETUP),
    Figure(fig09_gears.NAME, fig09_gears.draw, ("vehicle", "gear_set", "learner")),
)


@dataclass(frozen=True)
class Drawn:
    """What was drawn, and why a figure was not.

    Attributes:
        files: Files written.
        left_out: Reason by name of figure: what the run lacks for it.
    """

    files: list[Path]
    left_out: dict[str, str]


def draw_all(
    data: Campaign,
    folder: Path,
    chosen: Mapping[str, str | None] | None = None,
    suffixes: Sequence[str] = SUFFIXES,
    names: Sequence[str] | None = None,
    dpi: int = style.DPI,
) -> Drawn:
    """Draw the figures into a folder, each in every format.

    Args:
        data: The campaign.
        folder: Where to; made if it is not there.
        chosen: Values of columns of `SETUP`; what is not given is chosen by preference. A figure that shows all values
            of a column (gears in Fig. 9, learners in Fig. 4) takes no notice of a choice in it.
        suffixes: Formats.
        names: Figures by name, or the start of it (`fig05`); None: all.
        dpi: Dots per inch of pictures made of dots.

    Raises:
        ConfigError: A choice or a name does not exist, or a file cannot be written.
    """
    chosen = {name: value for name, value in (chosen or {}).items() if value is not None}
    data.select(**chosen)
    wanted = [f for f in FIGURES if names is None or any(f.name.startswith(name) for name in names)]
    for name in names or ():
        if not any(f.name.startswith(name) for f in FIGURES):
            raise ConfigError(f"no figure {name!r} (allowed {', '.join(f.name for f in FIGURES)})")
    style.make_folder(folder)
    drawn = Drawn([], {})
    for figure in wanted:
        part = data.select(**{c: v for c, v in chosen.items() if c in figure.single})
        part = part.preferred(*figure.single)
        lacks = missing(figure, part)
        if lacks:
            drawn.left_out[figure.name] = lacks
        else:
            paths = [folder / f"{figure.name}{suffix}" for suffix in suffixes]
            drawn.files.extend(figure.draw(part, paths, dpi))
    return drawn


def missing(figure: Figure, part: Campaign) -> str:
    """What a campaign lacks for a figure; empty if nothing."""
    if figure.name == fig04_convergence.NAME:
        return "" if len(part.episodes) else "the run kept no episodes"
    if figure.name == fig09_gears.NAME:
        return ""
    if not (part.trials["n_triggered"] > 0).any():
        return "no trial triggered"
    if figure.name == fig08_moment.NAME and not part.solved().any():
        return "no trial reached a landing rate of 0.8"
    return ""
