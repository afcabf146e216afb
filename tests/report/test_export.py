"""Exports read back with the formats' own readers and compared with the trace that they were made of."""

import csv
import json
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np
import planes
import pytest
from mcap.reader import make_reader
from planes import MOVING, NORMALS

import ivl
from ivl import export, landing, tracefile
from ivl.errors import ConfigError
from ivl.export import Format, csv_file, flight, topics
from ivl.export.source import Choice, resolve
from ivl.landing import LandingSpec
from ivl.sweep import store
from ivl.world import rotation


@pytest.fixture(scope="module")
def flown(spec: LandingSpec) -> flight.Flight:
    return flight.of_spec(spec, "a landing")


@pytest.fixture(scope="module")
def rows(spec: LandingSpec) -> Any:
    return spec.fly()[1].rows


@pytest.fixture(scope="module")
def mcap(flown: flight.Flight, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("mcap") / "landing.mcap"
    export.write(flown, path, Format.MCAP)
    return path


def messages(path: Path, topic: str) -> list[tuple[int, dict[str, Any]]]:
    with path.open("rb") as file:
        found = make_reader(file, validate_crcs=True).iter_messages(topics=[topic])
        return [(message.log_time, json.loads(message.data)) for _, _, message in found]


# ---- MCAP


def test_the_state_topic_holds_every_number_of_the_trace(mcap: Path, rows: Any) -> None:
    told = messages(mcap, "/ivl/state")
    assert len(told) == len(rows)
    for name, column in tracefile.columns(rows).items():
        assert [message[name] for _, message in told] == column.tolist(), name
    assert [t_ns for t_ns, _ in told] == [round(1e9 * t) for t in rows.t_s]
    assert {message["phase_name"] for _, message in told} >= {"approach", "flip", "coast"}


def test_transforms_and_poses_are_the_body_in_the_world(mcap: Path, rows: Any) -> None:
    frames, poses = messages(mcap, "/tf"), messages(mcap, "/ivl/pose")
    for i in range(0, len(rows), 97):
        (transform,), pose = frames[i][1]["transforms"], poses[i][1]["pose"]
        assert (transform["parent_frame_id"], transform["child_frame_id"]) == ("world", "body")
        assert list(transform["translation"].values()) == rows.p_WB_m[i].tolist() == list(pose["position"].values())
        assert list(transform["rotation"].values()) == rows.q_WB[i].tolist() == list(pose["orientation"].values())
        assert transform["timestamp"] == {"sec": int(rows.t_s[i]), "nsec": round(rows.t_s[i] % 1 * 1e9)}


def test_legs_reach_from_hip_to_foot_and_turn_green_when_they_stick(mcap: Path, rows: Any, world: ivl.World) -> None:
    scenes = messages(mcap, "/ivl/scene")
    assert {entity["id"] for entity in scenes[0][1]["entities"]} == {"ceiling", "body"}
    length_m = world.params.values["leg.length"]
    for i in range(0, len(rows), 61):
        (legs,) = scenes[i + 1][1]["entities"]
        feet = np.array([[line["points"][1][axis] for axis in "xyz"] for line in legs["lines"]])
        hips = np.array([[line["points"][0][axis] for axis in "xyz"] for line in legs["lines"]])
        assert (feet == rows.foot_W_m[i].reshape(4, 3)).all()
        assert np.linalg.norm(feet - hips, axis=1) == pytest.approx(np.full(4, length_m), abs=1e-4)
        green = [sphere["color"]["g"] > 0.5 for sphere in legs["spheres"]]
        assert green == (rows.foot_state[i] == 2).tolist()


def test_every_message_fits_the_schema_that_the_file_carries(mcap: Path) -> None:
    with mcap.open("rb") as file:
        seen = {}
        for schema, channel, message in make_reader(file).iter_messages():
            assert schema is not None
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            check(json.loads(schema.data), json.loads(message.data), channel.topic)
            seen[channel.topic] = schema.name
    assert seen == topics.TOPICS


TYPES = {
    "object": dict, "array": list, "string": str, "boolean": bool, "integer": int, "number": (int, float),
    "null": type(None),
}  # fmt: skip


def check(schema: dict[str, Any], value: Any, where: str) -> None:
    """The part of JSON Schema that the files use; fields must be declared and present, as Foxglove needs them."""
    kinds = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    assert any(isinstance(value, TYPES[kind]) for kind in kinds), where
    if kinds == ["object"]:
        assert set(value) == set(schema.get("properties", {})), where
        for name, part in schema.get("properties", {}).items():
            check(part, value[name], f"{where}.{name}")
    if kinds == ["array"]:
        for item in value:
            check(schema["items"], item, f"{where}[]")
    assert schema.get("minimum", value) <= value <= schema.get("maximum", value) if kinds == ["integer"] else True, (
        where
    )


def test_the_file_tells_what_was_flown_and_what_came_out(mcap: Path, spec: LandingSpec) -> None:
    with mcap.open("rb") as file:
        (record,) = make_reader(file).iter_metadata()
    assert record.name == "landing"
    assert float(record.metadata["spec.rrev_c_per_s"]) == spec.policy["rrev_c_per_s"]
    assert record.metadata["outcome.n_legs"] == "4"


def test_a_number_that_is_none_becomes_null(flown: flight.Flight) -> None:
    columns = {**flown.columns, "rrev_per_s": np.full(len(flown), np.nan)}
    broken = flight.Flight("x", columns, flown.phase, flown.world)
    states = [message for _, topic, message in topics.messages(broken) if topic == "/ivl/state"]
    assert {state["rrev_per_s"] for state in states} == {None}


# ---- surfaces


def at_another_surface(flown: flight.Flight, rows: Any, normal: str, velocity: Any) -> flight.Flight:
    seen = planes.Seen(flown.world, NORMALS[normal], velocity)
    return flight.Flight("x", tracefile.columns(seen.rows(rows)), flown.phase, seen.world)


def corners_W_m(center: Any, q: Any, size: Any) -> np.ndarray:
    """Corners of the face of a box that looks against its z axis, and of the one that looks along it."""
    signs = np.array([[i, j, k] for k in (-1, 1) for i in (-1, 1) for j in (-1, 1)])
    return np.array(center) + (signs * np.array(size) / 2) @ rotation(np.array(q)).T


@pytest.mark.parametrize("velocity", [(0.0, 0.0, 0.0), MOVING])
@pytest.mark.parametrize("normal", NORMALS)
def test_any_surface_is_drawn_where_it_is(
    flown: flight.Flight, rows: Any, tmp_path: Path, normal: str, velocity: tuple[float, float, float]
) -> None:
    other = at_another_surface(flown, rows, normal, velocity)
    surface = other.world.surface
    export.write(other, tmp_path / "x.mcap", Format.MCAP)
    told = messages(tmp_path / "x.mcap", "/ivl/scene")
    drawn = [(t_ns, e["cubes"][0]) for t_ns, m in told for e in m["entities"] if e["id"] == "ceiling"]
    assert len(drawn) == (len(rows) if surface.moves else 1)
    places = []
    for t_ns, cube in drawn:
        pose = cube["pose"]
        box = corners_W_m(*(list(part.values()) for part in (pose["position"], pose["orientation"], cube["size"])))
        assert surface.gap_m(box[:4], t_ns / 1e9) == pytest.approx(np.zeros(4), abs=1e-8)  # the face towards the room
        assert surface.gap_m(box[4:], t_ns / 1e9) == pytest.approx(np.full(4, -cube["size"]["z"]), abs=1e-8)
        places.append(surface.seen(list(pose["position"].values()), t_ns / 1e9))
    assert np.ptp(places, axis=0) == pytest.approx(np.zeros(3), abs=1e-8)  # it moves as the surface does
    ends = surface.seen(other.vector("p_WB_m", 3)[-1], other.t_s[-1])
    assert places[0][:2] == pytest.approx(ends[:2], abs=1e-8)  # and is where the flight ends


@pytest.mark.parametrize("velocity", [(0.0, 0.0, 0.0), MOVING])
@pytest.mark.parametrize("normal", ["level", "corner"])
def test_rerun_draws_any_surface_where_it_is(
    flown: flight.Flight, rows: Any, tmp_path: Path, normal: str, velocity: tuple[float, float, float]
) -> None:
    other = at_another_surface(flown, rows, normal, velocity)
    surface = other.world.surface
    export.write(other, tmp_path / "x.rrd", Format.RRD)
    told: dict[str, list[Any]] = {}
    for batch in rerun_columns(tmp_path / "x.rrd")["/world/ceiling"]:
        for name in batch.schema.names:
            told.setdefault(name.rpartition(":")[2], []).extend(batch.column(name).to_pylist())
    half = np.array(told["half_sizes"][0][0])
    center, q = np.array(told["centers"][0][0]), np.array(told["quaternions"][0][0])
    moved = np.array([row[0] for row in told["translation"] if row]) if surface.moves else np.zeros((1, 3))
    assert ("translation" in told) == surface.moves
    times = other.t_s if surface.moves else np.zeros(1)
    assert len(moved) == len(times)
    for shift, t_s in zip(moved[::37], times[::37], strict=True):
        box = corners_W_m(center + shift, q, 2 * half)
        assert surface.gap_m(box, t_s) == pytest.approx(np.repeat([half[2], -half[2]], 4), abs=1e-5)


# ---- layouts


def foxglove_paths(node: Any) -> set[str]:
    if isinstance(node, dict):
        own = {node["value"]} if isinstance(node.get("value"), str) else set()
        return own.union(*map(foxglove_paths, node.values()))
    return set().union(*map(foxglove_paths, node)) if isinstance(node, list) else set()


def panels(node: Any) -> list[str]:
    return [node] if isinstance(node, str) else [*panels(node["first"]), *panels(node["second"])]


def test_the_foxglove_layout_shows_topics_and_fields_that_exist(mcap: Path) -> None:
    layout = json.loads((export.LAYOUTS_DIR / "ivl_foxglove.json").read_text())
    assert sorted(panels(layout["layout"])) == sorted(layout["configById"])
    fields = set(messages(mcap, "/ivl/state")[0][1])
    paths = foxglove_paths(layout["configById"])
    assert len(paths) > 10
    assert {path.split(".")[0] for path in paths} == {"/ivl/state"}
    assert {path.split(".")[1] for path in paths} <= fields
    scene = layout["configById"]["3D!landing"]
    assert set(scene["topics"]) <= set(topics.TOPICS)
    assert scene["followTf"] == "body"


def test_the_plotjuggler_layout_shows_curves_that_exist(mcap: Path) -> None:
    root = ElementTree.parse(export.LAYOUTS_DIR / "ivl_plotjuggler.xml").getroot()
    curves = {curve.attrib["name"] for curve in root.iter("curve")}
    state = messages(mcap, "/ivl/state")[0][1]
    assert curves <= {f"/ivl/state/{name}" for name, value in state.items() if isinstance(value, int | float)}
    assert len(curves) > 10
    for splitter in root.iter("DockSplitter"):
        sizes = splitter.attrib["sizes"].split(";")
        assert len(sizes) == int(splitter.attrib["count"]) == len(list(splitter))


# ---- CSV


def test_csv_is_what_the_client_logs(flown: flight.Flight, rows: Any, tmp_path: Path) -> None:
    export.write(flown, tmp_path / "x.csv", Format.CSV)
    with (tmp_path / "x.csv").open() as file:
        reader = csv.DictReader(file)
        table = {name: [] for name in reader.fieldnames or ()}
        for row in reader:
            for name, text in row.items():
                table[name].append(text)
    assert next(iter(table)) == "Timestamp"
    assert all(re.fullmatch(r"[A-Za-z]+\.\w+", name) for name in list(table)[1:])
    assert table["Timestamp"] == [str(round(1000 * t)) for t in rows.t_s]
    number = {name: np.array(texts, dtype=float) for name, texts in table.items()}
    assert number["stateEstimate.z"] == pytest.approx(rows.p_WB_m[:, 2], rel=1e-8)
    assert number["stateEstimate.vx"] == pytest.approx(rows.v_WB_mps[:, 0], rel=1e-8, abs=1e-12)
    assert number["stateEstimate.qw"] == pytest.approx(rows.q_WB[:, 3], rel=1e-8, abs=1e-12)
    assert number["gyro.y"] == pytest.approx(np.rad2deg(rows.w_B_radps[:, 1]), rel=1e-8, abs=1e-9)
    assert number["ivl.rrev"] == pytest.approx(rows.rrev_per_s, rel=1e-8)
    assert number["ivl.phase"].tolist() == rows.phase.tolist()


def test_the_clients_pitch_is_positive_nose_up(flown: flight.Flight, rows: Any) -> None:
    """The trace's pitch is nose up as well; as an Euler angle it turns back at the vertical."""
    pitch = csv_file.columns(flown)["stabilizer.pitch"]
    early = np.flatnonzero((rows.pitch_deg > 5) & (rows.pitch_deg < 85))
    assert early.size > 5
    assert pitch[early] == pytest.approx(rows.pitch_deg[early], abs=0.5)


@pytest.mark.parametrize(
    ("axis", "angle_deg", "expected"),
    [("x", 30, (30, 0, 0)), ("y", 40, (0, -40, 0)), ("z", -70, (0, 0, -70)), ("x", 170, (170, 0, 0))],
)
def test_euler_angles_of_single_rotations(axis: str, angle_deg: float, expected: tuple[float, ...]) -> None:
    half = np.deg2rad(angle_deg) / 2
    q = np.array([[np.sin(half) * (axis == name) for name in "xyz"] + [np.cos(half)]])
    assert csv_file.euler_deg(q)[0] == pytest.approx(expected, abs=1e-9)


def test_log_variables_of_the_app_have_the_apps_names(flown: flight.Flight) -> None:
    header = (Path(__file__).parents[2] / "firmware" / "core" / "ivl_vars.h").read_text()
    logs = set(re.findall(r'X\(\w+, "ivl", "(\w+)", ivl_(?:out|state)_t', header))
    own = {name.split(".")[1] for name in csv_file.columns(flown) if name.startswith("ivl.")}
    assert own <= logs
    assert len(own) == 8


# ---- Rerun


def rerun_columns(path: Path) -> dict[str, Any]:
    from rerun.chunk import RrdReader

    found: dict[str, list[Any]] = {}
    for chunk in RrdReader(path).stream():
        found.setdefault(chunk.entity_path, []).append(chunk.to_record_batch())
    return found


def test_rerun_has_the_pose_and_the_series(flown: flight.Flight, rows: Any, tmp_path: Path) -> None:
    export.write(flown, tmp_path / "x.rrd", Format.RRD)
    found = rerun_columns(tmp_path / "x.rrd")
    body = found["/world/body"]
    names = body[0].schema.names
    translation = next(name for name in names if "translation" in name)
    told = np.array([value[0] for batch in body for value in batch.column(translation).to_pylist()])
    assert told == pytest.approx(rows.p_WB_m, abs=1e-6)
    times = [t.total_seconds() for batch in body for t in batch.column("landing").to_pylist()]
    assert times == pytest.approx(rows.t_s, abs=1e-6)
    pitch = [v[0] for batch in found["/plots/pitch_deg"] for v in batch.column("Scalars:scalars").to_pylist()]
    assert pitch == rows.pitch_deg.tolist()
    assert {"/world/legs", "/world/feet", "/world/ceiling", "/world/body/plates"} <= set(found)
    assert sum(batch.num_rows for batch in found["/world/feet"]) == len(rows)


def test_rerun_keeps_different_landings_apart_when_recordings_are_merged(spec: LandingSpec, tmp_path: Path) -> None:
    from rerun.chunk import RrdReader

    found = []
    for i, changes in enumerate(({}, {"seed": 1}, {"speed_mps": spec.speed_mps + 1e-6}, {})):
        path = tmp_path / f"{i}.rrd"
        export.write(flight.of_spec(spec.model_copy(update=changes), "a landing"), path, Format.RRD)
        found += [entry.recording_id for entry in RrdReader(path).recordings()]
    assert len(set(found)) == 3
    assert found[0] == found[3]


def test_without_rerun_the_message_says_what_to_install(tmp_path: Path) -> None:
    program = (
        "import sys; sys.modules['rerun'] = None\n"
        "from ivl.cli import run\n"
        f"sys.exit(run(['export', {str(write_spec(tmp_path))!r}, '--format', 'rrd']))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "rerun is not installed: pip install 'ivl[rerun]'" in done.stderr


# ---- where a landing comes from


def write_spec(folder: Path, **changes: Any) -> Path:
    fields = {"gear_set": "as_simulated", "speed_mps": 2.5, "angle_deg": 60.0, "rrev_c_per_s": 4.8, "moment_y_Nmm": 8.0}
    path = folder / "spec.yaml"
    path.write_text("".join(f"{name}: {value}\n" for name, value in {**fields, **changes}.items()))
    return path


def test_a_specification_is_flown(tmp_path: Path, rows: Any) -> None:
    found = resolve(write_spec(tmp_path), Choice())
    assert (found.columns["t_s"] == rows.t_s).all()
    assert (found.feet_W_m == rows.foot_W_m.reshape(-1, 4, 3)).all()  # type: ignore[union-attr]


def test_a_trace_file_reads_back_as_it_was(tmp_path: Path, rows: Any) -> None:
    for name in ("t.csv", "t.npz"):
        tracefile.write(tmp_path / name, rows)
        assert (tracefile.read(tmp_path / name) == rows).all()
        found = resolve(tmp_path / name, Choice(gear_set="as_simulated"))
        for column, values in tracefile.columns(rows).items():
            assert (found.columns[column] == values).all(), column


def test_a_rollout_of_a_learning_run_is_the_stored_one(learn_run: Path) -> None:
    found = resolve(learn_run, Choice(rollout=5))
    assert found.title == "small, trial 0, rollout 5"
    best = resolve(learn_run, Choice())
    assert best.facts["outcome.n_legs"] == "4"


def test_a_cell_of_a_sweep_gives_its_best_landing(sweep_run: Path) -> None:
    found = resolve(sweep_run, Choice(gear="wide_long", speed_mps=2.5, angle_deg=90.0, trial=1))
    trials = store.read_trials(sweep_run)
    row = trials[
        (trials["gear"] == "wide_long")
        & (trials["speed_mps"] == 2.5)
        & (trials["angle_deg"] == 90.0)
        & (trials["trial"] == 1)
    ].iloc[0]
    assert float(found.facts["spec.rrev_c_per_s"]) == row["best_rrev_c_per_s"]
    assert int(found.facts["outcome.n_legs"]) == row["best_n_legs"]


def recorder_table(rows: Any) -> str:
    """Rows as a downloaded flight recorder gives them, from a trace."""
    from ivl.links.packets import Recording

    kinds = [("t_s", "f8", ())]
    kinds += [(name, "f8", (n,)) for name, n in (("p_W_m", 3), ("v_W_mps", 3), ("q_WB", 4), ("w_B_radps", 3))]
    kinds += [("f_B_mps2", "f8", (3,)), ("d_ceil_m", "f8", ()), ("thrust_N", "f8", (4,))]
    table = np.zeros(len(rows), dtype=[*kinds, ("phase", "u1", ()), ("rule", "u1", ())])
    table["t_s"], table["p_W_m"], table["v_W_mps"], table["q_WB"] = rows.t_s, rows.p_WB_m, rows.v_WB_mps, rows.q_WB
    table["w_B_radps"], table["d_ceil_m"], table["thrust_N"] = rows.w_B_radps, rows.d_sensed_m, rows.thrust_cmd_N
    table["phase"], table["f_B_mps2"] = rows.phase, [0.0, 0.0, 9.80665]
    return Recording(1, 1, 0, None, 500.0, table).to_csv()


def test_a_flight_recorders_table_can_be_exported_too(tmp_path: Path, rows: Any) -> None:
    source = tmp_path / "flight.csv"
    source.write_text(recorder_table(rows))
    found = resolve(source, Choice(vehicle="crazyflie21"))
    assert found.feet_W_m is None
    assert found.columns["pitch_deg"] == pytest.approx(rows.pitch_deg, abs=1e-4)
    live = (rows.d_sensed_m > 0) & (rows.t_s < 0.5)
    assert found.columns["rrev_per_s"][live] == pytest.approx(rows.v_WB_mps[live, 2] / rows.d_sensed_m[live], rel=1e-6)
    for kind in Format:
        export.write(found, tmp_path / f"out.{kind.value}", kind)
    states = messages(tmp_path / "out.mcap", "/ivl/state")
    assert len(states) == len(rows)
    assert csv_file.columns(found)["acc.z"] == pytest.approx(np.ones(len(rows)))


def test_a_choice_that_does_not_fit_is_refused(tmp_path: Path, learn_run: Path, sweep_run: Path) -> None:
    cases = [
        (write_spec(tmp_path), Choice(trial=1), "--trial: spec.yaml is a specification"),
        (learn_run, Choice(gear="wide_long"), "--gear: .* is a run of `ivl learn`"),
        (learn_run, Choice(trial=3), r"--trial 3: .* has trials 0 .. 0"),
        (learn_run, Choice(rollout=24), r"--rollout 24: .* has rollouts 0 .. 23"),
        (sweep_run, Choice(rollout=1), "--rollout: .* is a sweep"),
        (sweep_run, Choice(gear="none"), r"no trial has gear 'none' \(allowed narrow_short, wide_long\)"),
        (sweep_run, Choice(speed_mps=3.0), r"no trial has speed_mps 3.0 \(allowed 1, 2.5\)"),
        (tmp_path / "missing", Choice(), "no such file or run folder"),
    ]
    for source, choice, message in cases:
        with pytest.raises(ConfigError, match=message):
            resolve(source, choice)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("t_s,p_WB_m_1\n0,1\n", "column p_WB_m_2 is missing for a trace"),
        ("t_s,p_x_W_m\n0,1\n", "column p_y_W_m is missing for the table of a flight recorder"),
        ("t_s,p_x_W_m\n0\n", "line 2: 1 fields, the header has 2"),
        ("t_s\nabc\n", "line 2: t_s: value 'abc' is no number"),
    ],
)
def test_a_file_that_is_something_else_is_named(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "x.csv"
    path.write_text(text)
    with pytest.raises(ConfigError, match=message):
        resolve(path, Choice())


def test_a_specification_with_a_mistake_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"spec.yaml: moment_y_Nmm: value 'x'"):
        landing.load(write_spec(tmp_path, moment_y_Nmm="x"))
    with pytest.raises(ConfigError, match=r"spec.yaml: speed: unknown key"):
        landing.load(write_spec(tmp_path, speed=3))


def test_a_file_that_cannot_be_written_is_named(flown: flight.Flight, tmp_path: Path) -> None:
    for kind in (Format.MCAP, Format.CSV):
        with pytest.raises(ConfigError, match="cannot be written"):
            export.write(flown, tmp_path / "missing" / "x", kind)
    with pytest.raises(ConfigError, match="the layouts cannot be written"):
        export.copy_layouts(tmp_path / "missing")
