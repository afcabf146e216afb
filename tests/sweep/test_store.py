import json
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from small_sweep import MAP, fly, make, write

import ivl
from ivl import report
from ivl.errors import StoreError
from ivl.layout import layout_of
from ivl.sweep import config, folder, schema, store
from ivl.sweep.config import PolicyMap, Sweep


@pytest.fixture
def small_map(tmp_path: Path) -> PolicyMap:
    return config.load_map(str(write(tmp_path / "map.yaml", MAP)))


@pytest.mark.parametrize("kind", schema.KINDS)
def test_every_column_has_a_unit_and_a_meaning_and_its_name_says_the_unit(kind: str, small: Sweep) -> None:
    layout = layout_of(small)
    suffix = {"m": "_m", "s": "_s", "deg": "_deg", "m/s": "_mps", "rad/s": "_radps", "1/s": "_per_s", "N mm": "_Nmm"}
    suffix["bytes"] = "_bytes"
    for field in schema.schema(kind, layout):
        unit = field.metadata[b"unit"].decode()
        assert field.metadata[b"doc"]
        assert not field.nullable
        if unit != "1":
            assert field.name.endswith(suffix[unit]), (field.name, unit)
    assert schema.units(kind, layout).keys() == set(schema.schema(kind, layout).names)


def test_tables_come_back_as_they_were_written(reference: Path, small: Sweep) -> None:
    for kind in ("trials", "episodes", "rollouts", "tasks"):
        table = store.read_table(reference, kind)
        assert table.schema.equals(schema.schema(kind, layout_of(small)), check_metadata=True)
        assert table.num_rows > 0
        assert all(column.null_count == 0 for column in table.columns)
        parts = [pq.read_table(path) for path in (reference / kind).glob("*.parquet")]
        assert table.num_rows == sum(part.num_rows for part in parts)
        assert all(part.schema.metadata[schema.VERSION_KEY] == b"2" for part in parts)


def test_pandas_keeps_seeds_names_and_units(reference: Path) -> None:
    frame = store.read_trials(reference)
    assert frame["seed"].dtype == np.int64
    assert frame["seed"].max() > 2**53
    assert isinstance(frame["gear"].dtype, pd.CategoricalDtype)
    assert frame.attrs["units"]["trigger_of_y_radps"] == "rad/s"
    key = list(schema.TRIAL_KEY)
    assert not frame.duplicated(key).any()
    plain = frame[key].astype(dict.fromkeys(key[:4], str))
    assert plain.equals(plain.sort_values(key))


def test_xarray_finds_each_trial_at_its_place(reference: Path) -> None:
    data, frame = store.to_xarray(reference), store.read_trials(reference)
    assert dict(data.sizes) == {"gear": 2, "speed_mps": 2, "angle_deg": 2, "trial": 2}
    assert data.attrs["learner"] == "ephe"
    assert data["trigger_vz_mps"].attrs["units"] == "m/s"
    for row in frame.itertuples():
        at = data.sel(gear=row.gear, speed_mps=row.speed_mps, angle_deg=row.angle_deg, trial=row.trial)
        assert int(at["seed"]) == row.seed
        assert float(at["reward_mean"]) == row.reward_mean


def test_xarray_of_an_unfinished_run_has_holes(reference: Path, tmp_path: Path, small: Sweep) -> None:
    run = fly(small, tmp_path / "run", 5)
    for kind in ("tasks", "trials"):
        (run / kind / "000000.parquet").unlink()
    data = store.to_xarray(run)
    assert int(data["reward_mean"].isnull().sum()) == 5
    assert dict(data.sizes) == dict(store.to_xarray(reference).sizes)


def test_a_map_s_points_are_what_a_direct_flight_gives(small_map: PolicyMap, tmp_path: Path) -> None:
    run = fly(small_map, tmp_path / "run", 1)
    frame, data = store.read_map(run), store.to_xarray(run, "map")
    assert len(frame) == 2 * 4 * 2 * 3
    assert dict(data.sizes) == {"gear": 2, "speed_mps": 2, "angle_deg": 2, "d_ceil_m": 2, "moment_Nmm": 3}
    for row in frame.sample(6, random_state=1).itertuples():
        world, stream = ivl.World(row.vehicle, row.gear, row.gear_set), row.first_stream + np.arange(3)
        out = world.rollouts(
            row.speed_mps,
            row.angle_deg,
            0.0,
            row.moment_Nmm,
            seed=row.seed,
            start="at_trigger",
            d_ceil_m=row.d_ceil_m,
            stream=stream,
        )
        assert (row.n, row.n_four_leg) == (3, (out.n_legs >= 3).sum())
        assert row.n_legs_mean == pytest.approx(out.n_legs.mean())
        age_s = 1 / out.rrev_trigger - 1 / row.rrev_per_s  # cues are held between poses at 100 Hz
        assert ((age_s > -1e-6) & (age_s < 0.0101)).all()
        assert row.of_y_radps * out.rrev_trigger == pytest.approx(out.of_y_trigger * row.rrev_per_s, rel=1e-5, abs=1e-5)
        assert row.vz_mps == pytest.approx(out.vz_trigger_mps, rel=1e-5)


def test_a_map_does_not_depend_on_its_tasks(small_map: PolicyMap, tmp_path: Path) -> None:
    runs = [fly(small_map, tmp_path / str(size), size, order) for size, order in ((1, 1), (3, -1))]
    assert store.read_map(runs[0]).equals(store.read_map(runs[1]))


def test_parts_of_another_version_or_shape_and_torn_ones_are_refused(small: Sweep, tmp_path: Path) -> None:
    run = fly(small, tmp_path / "run", 100)
    path = run / "trials" / "000000.parquet"
    content, table = path.read_bytes(), pq.read_table(path)
    flipped = bytearray(content)
    flipped[len(content) // 2] ^= 1
    for damaged in (content[:-100], b"", bytes(flipped)):
        path.write_bytes(damaged)
        with pytest.raises(StoreError, match=r"000000\.parquet: is not as it was written; --resume"):
            store.read_trials(run)
        assert 0 not in store.finished_tasks(run)
    without_digests(run)
    path.write_bytes(content[:-100])
    with pytest.raises(StoreError, match=r"000000\.parquet: cannot be read"):
        store.read_trials(run)
    pq.write_table(table.replace_schema_metadata({schema.VERSION_KEY: b"0"}), path)
    with pytest.raises(StoreError, match="schema version 0, this program reads 2"):
        store.read_trials(run)
    pq.write_table(table.append_column("extra", pa.array([0] * table.num_rows)), path)
    with pytest.raises(StoreError, match="other columns than this version's: extra"):
        store.read_trials(run)


def without_digests(run: Path) -> None:
    """Make the run one that was written before tasks vouched for their parts."""
    manifest = json.loads((run / "manifest.json").read_text())
    (run / "manifest.json").write_text(json.dumps({**manifest, "vouched": False}))
    for path in (run / "tasks").glob("*.parquet"):
        table = pq.read_table(path)
        kept = {key: value for key, value in table.schema.metadata.items() if key != store.INDEX_KEY}
        pq.write_table(table.replace_schema_metadata(kept), path)


def test_foreign_files_in_a_run_are_no_part_of_it(small: Sweep, tmp_path: Path) -> None:
    run = fly(small, tmp_path / "run", 5)
    trials, done = store.read_trials(run), store.finished_tasks(run)
    part = (run / "trials" / "000000.parquet").read_bytes()
    for name in ("._000000.parquet", "000000 (1).parquet", "000099.parquet", "x.parquet", ".DS_Store"):
        (run / "trials" / name).write_bytes(part)
    (run / "tasks" / "._000000.parquet").write_bytes(b"Mac OS X")
    assert store.read_trials(run).equals(trials)
    assert store.finished_tasks(run) == done
    (run / "tasks" / "000099.parquet").write_bytes((run / "tasks" / "000000.parquet").read_bytes())
    with pytest.raises(StoreError, match=r"000099\.parquet: is the record of task \[0\]"):
        store.read_trials(run)
    store.clear_unfinished(run)
    assert store.read_trials(run).equals(trials)


def test_what_is_no_run_is_said_to_be_none(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="holds no sweep"):
        store.read_manifest(tmp_path)
    (tmp_path / "manifest.json").write_text('{"schema_version": 2}')
    with pytest.raises(StoreError, match="is not the manifest of a sweep"):
        store.read_manifest(tmp_path)
    with pytest.raises(StoreError, match="is not the manifest of a sweep"):
        store.read_trials(tmp_path)


def test_a_table_that_does_not_exist_is_refused_and_one_without_parts_is_empty(small: Sweep, tmp_path: Path) -> None:
    worlds = {gear: small.make_world(gear) for gear in small.gear_names()}
    folder.open_run(tmp_path / "run", small, worlds, 100, resume=False).close()
    with pytest.raises(StoreError, match="no table 'people'"):
        store.read_table(tmp_path / "run", "people")
    assert store.read_trials(tmp_path / "run").empty


def test_a_sweep_of_an_older_version_is_refused_in_one_line_that_names_both(
    small: Sweep, small_map: PolicyMap, tmp_path: Path
) -> None:
    for grid in (small, small_map):
        run = tmp_path / grid.name
        worlds = {gear: grid.make_world(gear) for gear in grid.gear_names()}
        folder.open_run(run, grid, worlds, 100, resume=False).close()
        manifest = json.loads((run / "manifest.json").read_text())
        del manifest["layout"]  # as in version 1
        (run / "manifest.json").write_text(json.dumps({**manifest, "schema_version": 1, "ivl_version": "0.0.9"}))
        line = f"{run}: written by ivl 0.0.9 with schema version 1; this is ivl {ivl.__version__}, which reads schema"
        for use in (
            lambda run=run: store.read_trials(run),
            lambda run=run, grid=grid, worlds=worlds: folder.open_run(run, grid, worlds, 100, resume=True),
        ):
            with pytest.raises(StoreError) as caught:
                use()
            assert str(caught.value) == f"{line} version {schema.SCHEMA_VERSION} alone"
    with pytest.raises(StoreError, match=r"written by ivl 0\.0\.9 with schema version 1"):
        report.write(tmp_path / "small")


def test_the_manifest_says_what_was_run(reference: Path, small: Sweep) -> None:
    manifest = store.read_manifest(reference)
    assert manifest["sweep"] == small.model_dump(mode="json")
    assert manifest["units"]["trials"]["trigger_vx_mps"] == "m/s"
    assert manifest["parameters"]["wide_long"]["body.mass"] == 0.03584
    assert config.load_sweep(str(reference / "sweep.yaml")) == small


def test_only_the_same_run_is_resumed_and_only_once_at_a_time(small: Sweep, tmp_path: Path) -> None:
    run = fly(small, tmp_path / "run", 100)
    worlds = {gear: small.make_world(gear) for gear in small.gear_names()}
    with pytest.raises(StoreError, match="holds a run already: continue it with --resume"):
        folder.open_run(run, small, worlds, 100, resume=False)
    with pytest.raises(StoreError, match="cannot be resumed: trials: it has 2, now 3"):
        folder.open_run(run, make(tmp_path, trials=3), worlds, 100, resume=True)
    other = {gear: ivl.World("habas2021", gear, "table1") for gear in worlds}
    with pytest.raises(StoreError, match="the vehicle or gear files changed"):
        folder.open_run(run, small, other, 100, resume=True)
    with pytest.raises(StoreError, match="there is no run to resume"):
        folder.open_run(tmp_path / "nothing", small, worlds, 100, resume=True)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "letter.txt").write_text("mine")
    with pytest.raises(StoreError, match=r"is not empty \(letter\.txt"):
        folder.open_run(tmp_path / "full", small, worlds, 100, resume=False)
    opened = folder.open_run(run, small, worlds, 1, resume=True)
    assert opened.task_size == 100
    with pytest.raises(StoreError, match="another process is working on this run"):
        folder.open_run(run, small, worlds, 100, resume=True)
    opened.close()


def test_a_task_counts_only_when_all_its_parts_are_there(small: Sweep, tmp_path: Path) -> None:
    run = fly(small, tmp_path / "run", 5)
    n_tasks = len(list((run / "tasks").iterdir()))
    (run / "tasks" / "000001.parquet").unlink()  # cut off before the record
    (run / "trials" / ".ivl-0123456789abcdef.part.parquet").write_bytes(b"torn")
    assert store.finished_tasks(run) == set(range(n_tasks)) - {1}
    store.clear_unfinished(run)
    for kind in ("tasks", "trials", "episodes", "rollouts"):
        assert {path.name for path in (run / kind).iterdir()} == {
            f"{number:06d}.parquet" for number in range(n_tasks) if number != 1
        }
