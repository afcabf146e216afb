"""Landing rate against sensor set, over speed: what equipment suffices."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from ivl.plots import style

_COLOURS = (style.BLUE, style.SKY, style.GREEN, style.ORANGE, style.VERMILION, style.PURPLE, style.GREY, "black")
_MARKERS = "osDv^x+*"


@style.drawing
def draw(
    speeds_mps: Sequence[float], rates: Mapping[str, Sequence[float]], caption: str, paths: Sequence[Path]
) -> list[Path]:
    """Draw one curve for each sensor set.

    Args:
        speeds_mps: Approach speeds.
        rates: Label of a sensor set -> four-leg rate (0..1) of its best policy at each speed.
        caption: What was flown.
        paths: Files to write.
    """
    figure = style.new_figure(6.5, 4.2)
    axis = figure.subplots()
    for i, (label, values) in enumerate(rates.items()):
        colour, marker = _COLOURS[i % len(_COLOURS)], _MARKERS[i % len(_MARKERS)]
        axis.plot(
            speeds_mps, [100 * v for v in values], color=colour, marker=marker, markersize=5, linewidth=1.3, label=label
        )
    axis.set_xlabel("approach speed (m/s)")
    axis.set_ylabel("four-leg landings of the best policy (%)")
    axis.set_ylim(-2, 102)
    axis.set_title(caption, fontsize=style.NORMAL)
    axis.legend(fontsize=style.SMALL, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    style.finish(axis)
    return style.save(figure, paths)
