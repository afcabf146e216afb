"""What the figures of a campaign share: the tables of a run, one set-up out of them, and words for titles."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd  # type: ignore[import-untyped]

from ivl import forms, model
from ivl.analysis import region
from ivl.analysis.intervals import Estimate
from ivl.analysis.rates import RATE
from ivl.analysis.separability import separability
from ivl.errors import ConfigError
from ivl.outcome import solved
from ivl.sweep import store
from ivl.sweep.schema import VARIED, varied_columns

_PREFERRED = {
    "vehicle": model.DEFAULT_VEHICLE,
    "gear_set": model.DEFAULT_GEAR_SET,
    "gear": model.DEFAULT_GEAR,
    "learner": "bo",
}
SETUP = tuple(_PREFERRED)


@dataclass(frozen=True)
class Campaign:
    """Tables of a sweep's run folder (see `ivl.sweep.schema`); `episodes` may have no rows."""

    trials: pd.DataFrame
    episodes: pd.DataFrame

    def setups(self, *columns: str) -> list[dict[str, str]]:
        """Distinct values of some columns of `SETUP`, the preferred first."""
        found = self.trials[list(columns)].astype(str).drop_duplicates().to_dict("records")
        return sorted(found, key=lambda s: [(s[c] != _PREFERRED[c], s[c]) for c in columns])

    def select(self, **chosen: str | None) -> "Campaign":
        """The part with the given values of the columns `SETUP`; None selects nothing.

        Raises:
            ConfigError: There is no such part.
        """
        part = self
        for column, value in chosen.items():
            if value is None:
                continue
            present = sorted(part.trials[column].astype(str).unique())
            if value not in present:
                raise ConfigError(f"{column}: value {value!r} is not in this run (allowed {', '.join(present)})")
            part = replace(
                part,
                trials=part.trials[part.trials[column] == value],
                episodes=part.episodes[part.episodes[column] == value],
            )
        return part

    def preferred(self, *columns: str) -> "Campaign":
        """The part with the preferred value of each column (the first by name if that is not there)."""
        return self.select(**self.setups(*columns)[0])

    def solved(self) -> pd.Series:
        """Mask of the trials that triggered and reached a landing rate of 0.8."""
        return (self.trials["n_triggered"] > 0) & solved(self.trials[RATE])

    def title(self, *columns: str) -> str:
        """Values of some columns of `SETUP`, in words."""
        return ", ".join(words(self.trials, column) for column in columns)


def load(runs: Sequence[Path]) -> Campaign:
    """Read the run folders of one or several sweeps as one campaign.

    Raises:
        StoreError: One holds no sweep.
        ConfigError: One is a policy map, has another form of policies than the paper's, varies what no figure shows, or
            holds no finished trial.
    """
    trials, episodes = [], []
    for run in runs:
        manifest = store.read_manifest(run)
        if "sweep" not in manifest:
            raise ConfigError(f"{run}: is a policy map; figures are drawn of runs of `ivl sweep`")
        if (form := manifest["sweep"]["policy"]["form"]) != forms.PAPER:
            raise ConfigError(
                f"{run}: has policies of the form {form}; figures are those of {forms.PAPER} (`ivl report` shows any)"
            )
        trials.append(_plain(store.read_trials(run)))
        if varied := varied_columns(trials[-1]):
            paths = ", ".join(name.removeprefix(VARIED) for name in varied)
            raise ConfigError(f"{run}: varies {paths}, which the figures do not tell apart (`ivl report` does)")
        episodes.append(_plain(store.read_episodes(run)))
        if trials[-1].empty:
            raise ConfigError(f"{run}: holds no finished trial")
    return Campaign(pd.concat(trials, ignore_index=True), pd.concat(episodes, ignore_index=True))


def _plain(frame: pd.DataFrame) -> pd.DataFrame:
    """Names as plain text: categories of different runs do not mix."""
    return frame.astype(dict.fromkeys(SETUP, object))


def words(trials: pd.DataFrame, column: str) -> str:
    """The values of a column as a reader would say them."""
    values = sorted(trials[column].astype(str).unique())
    if column == "gear":
        return ", ".join(model.gear_title(value) for value in values)
    return ", ".join(values)


def points(data: Campaign) -> pd.DataFrame:
    """One point per trial of the selected part, the better ones last, so that they are drawn on top.

    Raises:
        ConfigError: No trial ever triggered.
    """
    found = region.trial_points(data.trials)
    if found.empty:
        raise ConfigError("no trial of this part of the run ever triggered: there is nothing to draw")
    return found.sort_values("rate_norm", kind="stable")


def auc_text(found: pd.DataFrame, space: str) -> str:
    """Cross-validated AUC of success in one of `region.CUE_SETS`, for a title."""
    result = separability(found[list(region.CUE_SETS[space])], found["success"], found["condition"])
    return f"AUC {interval(result.auc)}" if np.isfinite(result.auc.value) else "AUC not defined: one outcome alone"


def interval(estimate: Estimate, digits: int = 3) -> str:
    """A number with its interval."""
    return f"{estimate.value:.{digits}f} ({estimate.low:.{digits}f} to {estimate.high:.{digits}f})"
