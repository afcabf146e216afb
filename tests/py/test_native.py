from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from ivl import native
from ivl.errors import NativeError
from ivl.world import World

widest = native.library().use_registers()


def test_load_says_how_to_build_when_the_library_is_missing(tmp_path: Path) -> None:
    with pytest.raises(NativeError, match=r"none\.so: the native library is missing: run `make build`"):
        native.NativeLibrary(tmp_path / "none.so")


def test_load_says_how_to_build_when_the_file_is_no_library(tmp_path: Path) -> None:
    (tmp_path / "text.so").write_text("not a library")
    with pytest.raises(NativeError, match=r"cannot be loaded .*run `make build`"):
        native.NativeLibrary(tmp_path / "text.so")


def test_load_refuses_another_interface_version(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(native, "ABI_VERSION", native.ABI_VERSION + 1)
    with pytest.raises(NativeError, match="interface version"):
        native.NativeLibrary(native.library().path)


@pytest.mark.parametrize("inner", ["ivl_sim_fly", "ivl_sim_group_step", "ivl_step"])
def test_the_library_shows_its_interface_alone(inner: str) -> None:
    # what is called from one place in all is inlined there only if nobody outside can call it
    assert hasattr(native.library().c, "ivl_sil_rollouts")
    assert not hasattr(native.library().c, inner)


def test_library_can_be_chosen_by_the_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    copy = tmp_path / "copy.so"
    copy.write_bytes(native.library().path.read_bytes())
    monkeypatch.setenv(native.LIBRARY_ENV, str(copy))
    assert native.library.__wrapped__().path == copy


def random_landings(seed: int, n: int) -> npt.NDArray[np.void]:
    """Landings of every kind: any approach and policy, all ways to start, some of them hopeless."""
    rng = np.random.default_rng(seed)
    specs = native.library().default_specs(n)
    specs["speed_mps"], specs["angle_deg"] = rng.uniform(0.3, 4.0, n), rng.uniform(15.0, 90.0, n)
    specs["theta"][:, 0], specs["theta"][:, 1] = rng.uniform(0.5, 8.0, n), rng.uniform(0.0, 0.012, n)
    specs["start"] = rng.integers(0, 3, n)
    specs["seed"], specs["stream"] = seed, np.arange(n)
    return specs


@pytest.mark.parametrize(
    ("vehicle", "sensing"),
    [("habas2021", {}), ("crazyflie21", {"sense.gyro_noise": 0.05, "sense.latency": 0.01, "rrev.rate": 50.0})],
)
def test_landings_have_the_same_bits_in_registers_of_any_width(vehicle: str, sensing: dict[str, float]) -> None:
    library, world = native.library(), World(vehicle, "wide_short", "table1", **sensing)
    specs, found = random_landings(5, 101), {}
    try:
        for bits in (128, 256, 512, 0):
            if bits <= widest:
                library.use_registers(bits)
                found[bits], occupancy = world.native_model.rollouts_and_occupancy(specs, 2)
                assert 0.5 < occupancy <= 1
    finally:
        library.use_registers()
    assert len({outcomes.tobytes() for outcomes in found.values()}) == 1
    assert len(set(found[0]["end_reason"])) >= 2
    assert len(set(found[0]["n_legs"])) >= 3


def test_registers_are_those_of_the_environment_or_the_widest(monkeypatch: pytest.MonkeyPatch) -> None:
    try:
        monkeypatch.setenv(native.REGISTER_BITS_ENV, "128")
        assert native.NativeLibrary(native.library().path).use_registers(128) == 128
        monkeypatch.setenv(native.REGISTER_BITS_ENV, "96")
        with pytest.raises(NativeError, match="no registers of 96 bits here"):
            native.NativeLibrary(native.library().path)
    finally:
        assert native.library().use_registers() == widest


@pytest.mark.parametrize("bits", [1, 64, 192, 1024, "wide", "-1", ""])
def test_registers_that_no_machine_has_are_refused(bits: int | str) -> None:
    with pytest.raises(NativeError, match=f"no registers of {bits} bits here"):
        native.library().use_registers(bits)


def test_tables_describe_fields_that_do_not_overlap_and_have_a_unit_and_a_doc() -> None:
    library = native.library()
    for fields, dtype in (
        (library.spec_fields, library.spec_dtype),
        (library.outcome_fields, library.outcome_dtype),
        (library.trace_fields, library.trace_dtype),
        (library.derived_fields, library.derived_dtype),
        (library.replay_in_fields, library.replay_in_dtype),
        (library.replay_out_fields, library.replay_out_dtype),
    ):
        end = 0
        for field in sorted(fields.values(), key=lambda f: f.offset):
            assert field.offset >= end
            end = field.offset + dtype[field.name].itemsize
            assert field.unit
            assert field.doc
        assert end <= dtype.itemsize


def test_parameters_are_dotted_doubles_with_a_default_inside_the_range() -> None:
    for field in native.library().params.values():
        assert "." in field.name
        assert (field.type, field.count) == ("f8", 1)
        assert field.lo <= field.hi
        assert field.default is None or field.lo <= field.default <= field.hi


def test_create_model_passes_the_library_s_message_on_when_a_value_is_refused() -> None:
    library = native.library()
    values = np.array([field.default if field.default is not None else field.lo for field in library.params.values()])
    values[list(library.params).index("body.mass")] = np.nan
    with pytest.raises(NativeError, match=r"body\.mass"):
        library.create_model(values)


def test_create_model_refuses_a_vector_of_the_wrong_length() -> None:
    with pytest.raises(NativeError, match=r"shape \(3,\)"):
        native.library().create_model(np.zeros(3))


def test_end_reasons_and_phases_have_distinct_names() -> None:
    library = native.library()
    for name, field in ((library.end_reason, "end_reason"),):
        names = [name(code) for code in range(int(library.outcome_fields[field].hi) + 1)]
        assert len(set(names)) == len(names)
    phases = [library.phase_name(code) for code in range(int(library.trace_fields["phase"].hi) + 1)]
    assert len(set(phases)) == len(phases)
