from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from ivl.analysis import compact
from ivl.analysis.claims import evaluate
from ivl.layout import layout_of
from ivl.sweep import config, schema

LAYOUT = layout_of(config.load_sweep("sweeps/paper.yaml"))
Trials = Callable[..., pd.DataFrame]


def random_trials(trials: Trials) -> pd.DataFrame:
    rng = np.random.default_rng(0)
    frame = trials(tuple(np.arange(0.25, 4.01, 0.25)), tuple(np.arange(20.0, 91.0, 5.0)))
    n = len(frame)
    landed, attached = rng.integers(0, 25, n), rng.integers(0, 25, n)
    fore = rng.integers(0, attached + 1)
    with np.errstate(invalid="ignore"):
        frame = frame.assign(
            landing_rate_four_leg_norm=landed / 24,
            landing_rate_clean_norm=rng.integers(0, landed + 1) / 24,
            n_attached=attached,
            fore_legs_first_norm=np.where(attached > 0, fore / attached, np.nan),
            swing_completed_norm=np.where(fore > 0, rng.integers(0, fore + 1) / fore, np.nan),
            trigger_d_ceil_m=rng.uniform(0.05, 2, n),
            recommended_moment_y_Nmm=rng.uniform(0, 10.65, n),
        )
    frame.loc[3, [c for c in frame if c.startswith("trigger_")]] = np.nan
    frame.loc[3, "n_triggered"] = 0
    return frame


NO_EPISODES = pd.DataFrame({f.name: [] for f in schema.schema(schema.EPISODES, LAYOUT)})


def test_a_round_trip_keeps_counts_exactly_and_values_to_half_a_step(trials: Trials) -> None:
    frame = random_trials(trials)
    back = compact.unpack(compact.pack(frame.sample(frac=1, random_state=0), NO_EPISODES))
    frame = frame.sort_values(list(schema.TRIAL_KEY), ignore_index=True)
    shares = [*compact.SHARES, "swing_completed_norm"]
    assert back[shares].to_numpy() == pytest.approx(frame[shares].to_numpy(), abs=1e-12, nan_ok=True)
    for name, step in compact.STEPS.items():
        assert back[name].to_numpy() == pytest.approx(frame[name].to_numpy(), abs=step / 2 + 1e-9, nan_ok=True), name
    assert (back[list(schema.TRIAL_KEY)] == frame[list(schema.TRIAL_KEY)]).all(axis=None)


def test_packing_again_changes_nothing(trials: Trials) -> None:
    once = compact.pack(random_trials(trials), NO_EPISODES)
    twice = compact.pack(compact.unpack(once), NO_EPISODES)
    assert once.equals(twice)


def test_a_whole_campaign_is_small(trials: Trials, tmp_path: Path) -> None:
    table = compact.pack(random_trials(trials), NO_EPISODES)
    compact.write(table, tmp_path / "x.parquet")
    assert (tmp_path / "x.parquet").stat().st_size < 20 * len(table)
    assert pq.read_table(tmp_path / "x.parquet").equals(table)


def test_convergence_is_kept(trials: Trials) -> None:
    frame = trials((2.5,), (90.0,), n_trials=2)
    episodes = frame.loc[frame.index.repeat(4), list(schema.TRIAL_KEY)].reset_index(drop=True)
    episodes = episodes.assign(episode=[0, 1, 2, 3] * 2, n_scored=8, landing_rate_four_leg_norm=[1.0] * 4 + [0.0] * 4)
    reached = compact.unpack(compact.pack(frame, episodes))["rollouts_to_rate"]
    assert reached.tolist() == pytest.approx([24.0, np.nan], nan_ok=True)


def test_a_value_that_does_not_fit_is_refused(trials: Trials) -> None:
    with pytest.raises(OverflowError, match="trigger_d_ceil_m"):
        compact.pack(trials().assign(trigger_d_ceil_m=400.0), NO_EPISODES)


def test_claims_take_an_unpacked_campaign(trials: Trials) -> None:
    table = compact.pack(random_trials(trials), NO_EPISODES)
    assert [claim.number for claim in evaluate(compact.unpack(table), [1, 3, 9])] == [1, 3, 9]
