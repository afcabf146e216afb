"""Which parameters a belief has changed most, for those who can show only a few."""

import numpy as np
import numpy.typing as npt

SHOWN_MAX = 6


def most_changed(levels: npt.NDArray[np.float64]) -> list[int]:
    """The parameters whose quantiles, shape (n_times, n_parameters, 5), moved or narrowed most, at most six."""
    before, after = levels[0], levels[-1]
    width = np.maximum(before[:, 3] - before[:, 1], np.finfo(np.float64).tiny)
    moved = np.abs(after[:, 2] - before[:, 2]) / width
    narrowed = 1.0 - (after[:, 3] - after[:, 1]) / width
    return [int(i) for i in np.argsort(-(moved + np.maximum(narrowed, 0.0)), kind="stable")[:SHOWN_MAX]]
