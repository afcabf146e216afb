"""Convergence of a run in the manner of the paper's Fig. 4: mu +- 2 sigma of each parameter, and the landing rate."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from ivl.experiment import Experiment
from ivl.learning.recorder import SCORED, EpisodeRow, RolloutRows
from ivl.outcome import RECENT_EPISODES, clean, four_leg
from ivl.plots import style
from ivl.run import RunResult

_SHOWN_MAX = 8  # parameters in the figure, the first of a longer form
_FLOWN_COLOURS = (style.PURPLE, style.DIM)
OUTCOMES = (
    ("four legs, clean", style.GREEN, "o"),
    ("four legs, body contact", style.SKY, "s"),
    ("one or two legs", style.ORANGE, "^"),
    ("no leg", style.VERMILION, "x"),
)


def draw_run(result: RunResult) -> list[Path]:
    """Draw trial 0 of a finished run into its folder, as PNG and SVG."""
    paths = [result.folder / f"convergence{suffix}" for suffix in (".png", ".svg")]
    return draw(
        result.experiment, result.history, result.rollouts, paths, result.summary.get("rollouts_to_convergence")
    )


@style.drawing
def draw(
    experiment: Experiment,
    history: Sequence[EpisodeRow],
    rollouts: RolloutRows,
    paths: Sequence[Path],
    converged_at: int | None = None,
) -> list[Path]:
    """Draw one trial.

    Args:
        experiment: What was run: start of the search and bounds.
        history: Episodes of the trial, in order.
        rollouts: Rollouts of the trial.
        paths: Files to write.
        converged_at: Rollouts to convergence; drawn as a line unless None.
    """
    form = experiment.policy.shape
    shown = form.params[:_SHOWN_MAX]
    figure = style.new_figure(6.5, 2.5 + 2.0 * len(shown))
    axes = figure.subplots(len(shown) + 1, 1, sharex=True, height_ratios=(*(3 for _ in shown), 2))
    for i, parameter in enumerate(shown):
        _draw_parameter(axes[i], experiment, history, rollouts, i)
        _draw_flown(axes[i], experiment, i)
        axes[i].set_ylabel(parameter.label)
    _draw_rate(axes[-1], experiment, history)
    axes[-1].set_xlabel("rollout")
    for axis in axes:
        axis.set_xlim(0, experiment.budget)
        style.finish(axis)
        if converged_at is not None:
            axis.axvline(converged_at, color=style.GREY, linewidth=1, linestyle=":")
    if converged_at is not None:
        text = f"solved after {converged_at} "
        axes[-1].text(converged_at, 0.96, text, ha="right", va="top", color=style.GREY, fontsize=style.SMALL)
    axes[0].set_title(
        f"{experiment.name}: {experiment.gear_set}/{experiment.gear}, {experiment.speed_mps:g} m/s at "
        f"{experiment.angle_deg:g}°, {experiment.learner.name}, seed {experiment.seed}"
        + (f"\nform {form.name}, the first {len(shown)} of {form.n} parameters" if form.n > len(shown) else ""),
        fontsize=style.NORMAL,
    )
    figure.legend(
        *axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=style.SMALL, frameon=False
    )
    return style.save(figure, paths)


def _draw_parameter(
    axis: Axes, experiment: Experiment, history: Sequence[EpisodeRow], rollouts: RolloutRows, i: int
) -> None:
    """One dot per rollout in the colour of its outcome, over the search distribution that it was drawn from."""
    parameter = experiment.policy.parameters[i]
    mu = np.array([parameter.mu0] + [row.mu[i] for row in history])
    sigma = np.array([parameter.sigma0] + [row.sigma[i] for row in history])
    at = experiment.n_rollouts * np.arange(len(mu))
    axis.fill_between(
        at, mu - 2 * sigma, mu + 2 * sigma, step="post", color=style.BLUE, alpha=0.15, linewidth=0, label="µ ± 2σ"
    )
    axis.step(at, mu, where="post", color=style.BLUE, linewidth=1.2, label="µ")
    number = rollouts.episode * experiment.n_rollouts + rollouts.idx + 0.5
    for (label, color, marker), chosen in zip(OUTCOMES, outcome_classes(rollouts), strict=True):
        axis.scatter(
            number[chosen], rollouts.theta[chosen, i], s=12, color=color, marker=marker, linewidths=1, label=label
        )
    axis.set_ylim(*_limits(parameter.bounds, rollouts.theta[:, i]))


def _draw_flown(axis: Axes, experiment: Experiment, i: int) -> None:
    """Where real flights landed: a band, or a line where they flew one policy."""
    for flown, colour in zip(experiment.flown, _FLOWN_COLOURS * len(experiment.flown), strict=False):
        lo, hi = flown.of(experiment.policy.shape, "flown")[i]
        if hi > lo:
            axis.axhspan(lo, hi, color=colour, alpha=0.3, linewidth=0, label=flown.label)
        else:
            axis.axhline(lo, color=colour, linewidth=1.2, linestyle="--", label=flown.label)


def _draw_rate(axis: Axes, experiment: Experiment, history: Sequence[EpisodeRow]) -> None:
    rates = np.array([row.rate_four_leg for row in history])
    recent = [np.nanmean(rates[max(0, k + 1 - RECENT_EPISODES) : k + 1]) for k in range(len(rates))]
    at = experiment.n_rollouts * (np.arange(len(rates)) + 1)
    axis.bar(at - experiment.n_rollouts / 2, rates, width=0.85 * experiment.n_rollouts, color=style.GREEN, alpha=0.35)
    axis.plot(at, recent, color=style.BLUE, linewidth=1.2)
    axis.set_ylim(0, 1.05)
    axis.set_ylabel("four-leg rate\n(line: last three)")


def outcome_classes(rollouts: RolloutRows) -> list[npt.NDArray[np.bool_]]:
    """Masks of the scored rollouts in the order of `OUTCOMES`."""
    scored = rollouts.status == SCORED
    four, spotless = four_leg(rollouts.outcomes), clean(rollouts.outcomes)
    some = (rollouts.outcomes["n_legs"] > 0) & ~four
    none = rollouts.outcomes["n_legs"] == 0
    return [np.asarray(mask & scored) for mask in (spotless, four & ~spotless, some, none)]


def _limits(bounds: Sequence[float], values: npt.NDArray[np.float64]) -> tuple[float, float]:
    lo, hi = min(bounds[0], values.min()), max(bounds[1], values.max())
    margin = 0.03 * (hi - lo)
    return float(lo - margin), float(hi + margin)
