"""Intervals of shares and of means over trials, and why these.

share     k of n independent yes/no answers: Wilson's score interval. It keeps its level down to n = 5 and at k = 0 or
          k = n, where the textbook interval and the bootstrap have no width at all.
mean      of the landing rates of n trials. Rollouts of one trial share a policy, so they are not independent and
          Wilson's interval over all of them would be far too narrow. Rates lie in 0 .. 1, so the variance of one is at
          most p (1 - p): Wilson's interval with the number of *trials* in the place of n covers at least as often as
          it says, however alike the rollouts of a trial are. Nothing has to be estimated from five numbers.
contrast  differences of averages over many cells: the variance within each cell, estimated without bias from its
          trials, summed over the cells (a stratified sample). A bootstrap of five trials a cell would give 4/5 of it.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Z95 = 1.959963984540054
"""Two-sided 95 % quantile of the standard normal distribution."""

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Estimate:
    """A number and its 95 % interval.

    Attributes:
        value: The estimate; NaN if there is nothing to estimate it from.
        low: Lower end.
        high: Upper end.
        n: What it rests on (trials, conditions ...), see the function that made it.
    """

    value: float
    low: float
    high: float
    n: int


def wilson(share: npt.ArrayLike, n: npt.ArrayLike, z: float = Z95) -> tuple[FloatArray, FloatArray]:
    """Wilson's score interval.

    Args:
        share: Observed share or mean of values in 0 .. 1, any shape.
        n: Number of independent observations, of a shape that broadcasts; where 0, the interval is 0 .. 1.
        z: Quantile.

    Returns:
        Lower and upper end in the broadcast shape.

    Raises:
        ValueError: A share lies outside of 0 .. 1.
    """
    p, count = np.broadcast_arrays(np.asarray(share, dtype=np.float64), np.asarray(n, dtype=np.float64))
    empty = count <= 0
    if ((p < 0) | (p > 1))[~empty].any():
        raise ValueError("wilson: a share lies outside of 0 .. 1")
    safe = np.where(empty, 1.0, count)
    p = np.where(empty, 0.5, p)
    center = (p + z * z / (2 * safe)) / (1 + z * z / safe)
    half = z / (1 + z * z / safe) * np.sqrt(p * (1 - p) / safe + z * z / (4 * safe * safe))
    low = np.where(empty | (p <= 0), 0.0, center - half)
    high = np.where(empty | (p >= 1), 1.0, center + half)
    return np.clip(low, 0, 1), np.clip(high, 0, 1)


def share_of(happened: npt.ArrayLike) -> Estimate:
    """Share of true values among independent yes/no answers, with Wilson's interval."""
    answers = np.asarray(happened, dtype=bool).ravel()
    if not answers.size:
        return Estimate(float("nan"), 0.0, 1.0, 0)
    value = float(answers.mean())
    low, high = wilson(value, answers.size)
    return Estimate(value, float(low), float(high), answers.size)


def stratified_mean(values: npt.ArrayLike, stratum: npt.ArrayLike) -> Estimate:
    """Mean over strata (cells) of the mean within each, every stratum with the same weight.

    The interval is that of drawing the trials of the same cells anew; cells are a fixed grid and are not resampled.

    Args:
        values: Landing rates of trials, shape (n,).
        stratum: Cell of each, shape (n,), any hashable kind that numpy can sort.

    Returns:
        The mean; `n` is the number of strata. Strata with one value contribute the mean variance of the others; if all
        have one value, the interval has the ends NaN.
    """
    rate, cell = np.asarray(values, dtype=np.float64), np.asarray(stratum)
    if rate.shape != cell.shape or rate.ndim != 1:
        raise ValueError(f"stratified_mean: shapes {rate.shape} and {cell.shape} differ or are not one-dimensional")
    if not rate.size:
        return Estimate(float("nan"), float("nan"), float("nan"), 0)
    _, index, count = np.unique(cell, return_inverse=True, return_counts=True)
    mean = np.bincount(index, rate) / count
    squares = np.bincount(index, (rate - mean[index]) ** 2)
    several = count > 1
    variance = np.full(len(count), np.nan)
    variance[several] = squares[several] / (count[several] - 1)
    variance[~several] = variance[several].mean() if several.any() else np.nan
    half = Z95 * float(np.sqrt((variance / count).sum())) / len(count)
    value = float(mean.mean())
    return Estimate(value, value - half, value + half, len(count))


def difference(first: Estimate, second: Estimate) -> Estimate:
    """`first - second` of two independent estimates; `n` is the smaller of the two.

    Of each the wider side counts: the other may have been cut off at 0 or 1.
    """
    sides = [max(side.high - side.value, side.value - side.low) for side in (first, second)]
    half = np.hypot(sides[0], sides[1])
    value = first.value - second.value
    return Estimate(value, value - float(half), value + float(half), min(first.n, second.n))


def worst_tenth(rates: npt.ArrayLike) -> float:
    """Mean over the tenth of the vehicles with the lowest rates, over one at least; rates of shape (n,)."""
    rising = np.sort(np.asarray(rates, dtype=np.float64))
    return float(rising[: -(-rising.size // 10)].mean())
