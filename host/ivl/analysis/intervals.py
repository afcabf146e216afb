"""Intervals of shares and of means over trials, and why these.

share     k of n independent yes/no answers: Wilson's score interval. It keeps its level down to n = 5 and at k = 0 or
          k = n, where the textbook interval and the bootstrap have no width at all.
mean      of the landing rates of n trials. Rollouts of one trial share a policy, so they are not independent and
          Wilson's interval over all of them would be far too narrow. Rates lie in 0 .. 1, so the variance of one is at
          most p (1 - p): Wilson's interval with the number of *trials* in the place of n covers at least as often as
          it says, however alike the rollouts of a trial are. Nothing has to be estimated from five numbers.
clusters  share of answers that are alike within clusters, of one kind or of two crossed ones (vehicles, approaches):
          the variance between them says how many independent answers they are worth, for Wilson's interval.
contrast  differences of averages over many cells: the variance within each cell, estimated without bias from its
          trials, summed over the cells (a stratified sample). A bootstrap of five trials a cell would give 4/5 of it.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Z95 = 1.959963984540054
"""Two-sided 95 % quantile of the standard normal distribution."""
_SLACK = 1e-9
_CLUSTERS_MIN = 4
"""From so few clusters no variance is estimated."""

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


def share_of_clusters(happened: npt.ArrayLike, counted: npt.ArrayLike, *clusters: npt.ArrayLike) -> Estimate:
    """Share of true values among answers that are alike within clusters: flights of one vehicle, or of one approach.

    The variance of the share is that between the clusters, of crossed ones their sum less what both hold (Cameron,
    Gelbach and Miller 2011). The answers count as so many independent ones as have this variance, but never as more
    than there are (Kish's design effect). Wilson's interval with that number, and with Student's quantile for the
    number of clusters, has its level at small shares, too. Where all answers are equal, or fewer than four clusters
    have any, nothing tells how alike they are, and a cluster counts as one answer. Clusters of unequal size count as
    fewer equal ones. Where a cluster has one answer each, this is `share_of`.

    Args:
        happened: True or false, any shape.
        counted: Which answers count, same shape.
        *clusters: Number of the cluster of each answer, same shape; one array for each way to cluster.

    Returns:
        The share; `n` is the number of answers that count.
    """
    counts = np.asarray(counted, dtype=bool).ravel()
    answers = np.asarray(happened, dtype=np.float64).ravel()[counts]
    n = answers.size
    if not n:
        return Estimate(float("nan"), 0.0, 1.0, 0)
    value = float(answers.mean())
    found = [np.unique(np.asarray(of).ravel()[counts], return_inverse=True)[1] for of in clusters]
    sizes = [np.bincount(index) for index in found]
    fewest = min(n**2 / float(size @ size) for size in sizes)  # as many clusters of equal size
    if fewest < _CLUSTERS_MIN or value in (0.0, 1.0):
        low, high = wilson(value, fewest)
        return Estimate(value, float(low), float(high), n)
    error = answers - value
    alone = _between(error, np.arange(n))
    between = [_between(error, index) for index in found]
    design = max(alone, *between, sum(between) - (len(between) - 1) * alone) / alone
    alike = design > 1.0 + _SLACK
    low, high = wilson(value, n / design, student95(fewest - 1) if alike else Z95)
    return Estimate(value, float(low), float(high), n)


def _between(error: FloatArray, cluster: npt.NDArray[np.intp]) -> float:
    """Variance of a mean of which `error` are the deviations, from the sums over clusters, but for a common factor."""
    sums, size = np.bincount(cluster, error), np.bincount(cluster)
    fewest = error.size**2 / float(size @ size)
    return float(fewest / (fewest - 1) * (sums @ sums))


def student95(freedom: float) -> float:
    """Two-sided 95 % quantile of Student's t, by its expansion about the normal one; within 1 % from 3 degrees on."""
    z = Z95
    terms = (
        z,
        (z**3 + z) / 4,
        (5 * z**5 + 16 * z**3 + 3 * z) / 96,
        (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384,
    )
    return sum(term / freedom**i for i, term in enumerate(terms))


def worst_tenth(rates: npt.ArrayLike) -> float:
    """Mean over the tenth of the vehicles with the lowest rates, over one at least; rates of shape (n,)."""
    rising = np.sort(np.asarray(rates, dtype=np.float64))
    return float(rising[: -(-rising.size // 10)].mean())
