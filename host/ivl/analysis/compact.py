"""A campaign small enough to be kept beside its results: one row per trial, whole numbers of stated steps.

The claims and tables of docs/RESULTS.md need a dozen columns of the table of trials, at the precision of what is
printed. `pack` keeps these as integers (a value is the integer times the column's step; what does not exist is null),
which compress to about 14 bytes a trial; `unpack` gives a table of trials back, rounded, on which every function of
this package works.
"""

from pathlib import Path

import numpy as np
import pandas as pd  # type: ignore[import-untyped]
import pyarrow as pa  # type: ignore[import-untyped]
import pyarrow.parquet as pq  # type: ignore[import-untyped]

from ivl.analysis.policy import MOMENT, THRESHOLD, recommended
from ivl.analysis.rates import rollouts_to_rate
from ivl.errors import ConfigError
from ivl.sweep.schema import TRIAL_KEY, varied_columns

_NAMES = ("vehicle", "gear_set", "gear", "learner")
COUNTS = ("trial", "n_recent", "n_triggered", "n_attached", "n_check", "rollouts_to_rate")
STEPS = {
    "speed_mps": 0.01,
    "angle_deg": 0.01,
    recommended(THRESHOLD): 0.01,
    recommended(MOMENT): 0.05,
    "trigger_vx_mps": 0.01,
    "trigger_vz_mps": 0.01,
    "trigger_d_ceil_m": 0.002,
    "trigger_rrev_per_s": 0.01,
    "trigger_of_y_radps": 0.02,
}
"""Step of each column that is no count."""
SHARES = {
    "landing_rate_four_leg_norm": "n_recent",
    "landing_rate_clean_norm": "n_recent",
    "check_rate_four_leg_norm": "n_check",
    "check_rate_clean_norm": "n_check",
    "fore_legs_first_norm": "n_attached",
}
"""Shares, kept as the count that they are of the column named here; `swing_completed_norm` is one of the last."""


def pack(trials: pd.DataFrame, episodes: pd.DataFrame) -> pa.Table:
    """The columns that the results need, as integers.

    Args:
        trials: Table of trials.
        episodes: Table of episodes of the same trials; without rows, convergence is unknown.

    Raises:
        ConfigError: The sweep varies what the packed table has no column for.
    """
    if varied := varied_columns(trials):
        raise ConfigError(f"a packed campaign has no column {varied[0]}: pack the variants of a sweep one by one")
    keys = list(TRIAL_KEY)
    frame = trials.astype(dict.fromkeys(_NAMES, object)).sort_values(keys, ignore_index=True)
    frame["rollouts_to_rate"] = np.nan
    if len(episodes):
        reached = rollouts_to_rate(episodes).astype(dict.fromkeys(_NAMES, object)).set_index(keys)
        frame["rollouts_to_rate"] = (
            reached["rollouts_to_rate"].reindex(pd.MultiIndex.from_frame(frame[keys])).to_numpy()
        )
    columns = {name: pa.array(frame[name]).dictionary_encode() for name in _NAMES}
    columns |= {name: _integers(frame[name]) for name in COUNTS}
    columns |= {name: _integers(frame[name] / step) for name, step in STEPS.items()}
    columns |= {name: _integers(frame[name] * frame[of]) for name, of in SHARES.items()}
    n_fore = (frame["fore_legs_first_norm"] * frame["n_attached"]).round()
    columns["swing_completed_norm"] = _integers(frame["swing_completed_norm"] * n_fore)
    return pa.table(columns)


def unpack(table: pa.Table) -> pd.DataFrame:
    """A table of trials, with the columns that `pack` kept and in its rounding."""
    packed = table.to_pandas(ignore_metadata=True).astype(dict.fromkeys(_NAMES, object))
    frame = packed.astype({name: float for name in packed if name not in _NAMES})
    n_fore = frame["fore_legs_first_norm"].copy()
    for name, step in STEPS.items():
        frame[name] = (frame[name] * step).round(3)
    for name, of in SHARES.items():
        frame[name] = frame[name] / frame[of].where(frame[of] > 0)
    frame["swing_completed_norm"] = frame["swing_completed_norm"] / n_fore.where(n_fore > 0)
    whole = [name for name in COUNTS if name != "rollouts_to_rate"]
    return frame.astype(dict.fromkeys(whole, int))


def write(table: pa.Table, path: Path) -> None:
    """Write a packed table as Parquet: the two bytes of the integers apart, which compresses best."""
    numbers = [field.name for field in table.schema if not pa.types.is_dictionary(field.type)]
    names = [field.name for field in table.schema if pa.types.is_dictionary(field.type)]
    pq.write_table(
        table,
        path,
        compression="zstd",
        compression_level=19,
        use_dictionary=names,
        column_encoding=dict.fromkeys(numbers, "BYTE_STREAM_SPLIT"),
    )


def _integers(values: pd.Series) -> pa.Array:
    """Rounded to the nearest integer of 16 bits; what is not finite becomes null.

    Raises:
        OverflowError: A value does not fit.
    """
    rounded = values.to_numpy(dtype=np.float64).round()
    known = np.isfinite(rounded)
    limits = np.iinfo(np.int16)
    if known.any() and not limits.min <= rounded[known].min() <= rounded[known].max() <= limits.max:
        raise OverflowError(f"{values.name}: a value does not fit into 16 bits: {rounded[known].min():g} ..")
    return pa.array(np.where(known, rounded, 0).astype(np.int16), mask=~known)


_STATE_STEPS = {
    "speed_mps": 0.01,
    "angle_deg": 0.01,
    "d_ceil_m": 0.001,
    "moment_low_Nmm": 0.01,
    "moment_high_Nmm": 0.01,
}
_STATE_COUNTS = ("n_moments", "n_landing")
_SETUP = ("vehicle", "gear_set", "gear")


def pack_states(states: pd.DataFrame) -> pa.Table:
    """States of a policy map (see `region.map_states`) as integers."""
    columns = {name: pa.array(states[name].astype(object)).dictionary_encode() for name in _SETUP}
    columns |= {name: _integers(states[name]) for name in _STATE_COUNTS}
    return pa.table(columns | {name: _integers(states[name] / step) for name, step in _STATE_STEPS.items()})


def unpack_states(table: pa.Table) -> pd.DataFrame:
    """States of a policy map, with every column that `region.map_states` gives."""
    frame = table.to_pandas(ignore_metadata=True).astype(dict.fromkeys(_SETUP, object))
    for name, step in _STATE_STEPS.items():
        frame[name] = (frame[name] * step).round(3)
    angle_rad = np.deg2rad(frame["angle_deg"])
    vx, vz = frame["speed_mps"] * np.cos(angle_rad), frame["speed_mps"] * np.sin(angle_rad)
    return frame.assign(
        vx_mps=vx,
        vz_mps=vz,
        rrev_per_s=vz / frame["d_ceil_m"],
        of_y_radps=-vx / frame["d_ceil_m"],
        moment_Nmm=(frame["moment_low_Nmm"] + frame["moment_high_Nmm"]) / 2,
        success=frame["n_landing"] > 0,
        condition=frame.groupby(["speed_mps", "angle_deg"]).ngroup(),
    )
