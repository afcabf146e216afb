from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from ivl import model, native
from ivl.errors import ConfigError

GEARS = ["extra_narrow_short", "narrow_short", "wide_short", "extra_narrow_long", "narrow_long", "wide_long"]


def changed_vehicle(tmp_path: Path, old: str, new: str) -> str:
    text = (model.VEHICLES_DIR / "habas2021.yaml").read_text()
    assert old in text
    path = tmp_path / "v.yaml"
    path.write_text(text.replace(old, new))
    return str(path)


def changed_gear(tmp_path: Path, old: str, new: str) -> str:
    text = (model.GEARS_DIR / "table1.yaml").read_text()
    assert old in text
    path = tmp_path / "g.yaml"
    path.write_text(text.replace(old, new, 1))
    return str(path)


@pytest.mark.parametrize("vehicle", model.list_vehicles())
@pytest.mark.parametrize("gear_set", ["table1", "as_simulated"])
@pytest.mark.parametrize("gear", GEARS)
def test_every_shipped_combination_defines_every_parameter_once(vehicle: str, gear_set: str, gear: str) -> None:
    parameters = model.assemble((model.load_vehicle(vehicle), model.load_gear(gear, gear_set)))
    assert list(parameters.values) == list(native.library().params)


def test_lists_name_what_ships() -> None:
    assert model.list_vehicles() == ["crazyflie21", "crazyflie21_brushless", "habas2021"]
    assert model.list_gear_sets() == ["as_simulated", "table1"]
    assert model.list_gears("table1") == GEARS


@pytest.mark.parametrize(
    ("gear_set", "gear", "length_m", "angle_deg", "mass_kg"),
    [
        ("table1", "wide_short", 0.05, 60.0, 0.44e-3),
        ("table1", "wide_long", 0.1, 60.0, 0.88e-3),
        ("as_simulated", "wide_short", 0.05, 50.0, 0.44e-3),
        ("as_simulated", "narrow_long", 0.075, 30.0, 0.66e-3),
    ],
)
def test_gears_have_the_published_dimensions(
    gear_set: str, gear: str, length_m: float, angle_deg: float, mass_kg: float
) -> None:
    values = {name: q.value for name, q in model.load_gear(gear, gear_set).quantities.items()}
    assert (values["leg.length"], values["leg.angle"]) == (length_m, angle_deg)
    assert values["leg.mass"] == pytest.approx(mass_kg)


@pytest.mark.parametrize("folder", [model.VEHICLES_DIR, model.GEARS_DIR])
def test_every_shipped_number_has_unit_and_source(folder: Path) -> None:
    def leaves(node: object) -> list[dict[str, object]]:
        if not isinstance(node, dict):
            return []
        if "value" in node:
            return [node]
        return [leaf for child in node.values() for leaf in leaves(child)]

    for path in folder.glob("*.yaml"):
        numbers = leaves(yaml.safe_load(path.read_text()))
        assert numbers
        assert all(leaf["unit"] and leaf["source"] for leaf in numbers)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("value: 0.03584", "value: -1", "v.yaml: body.mass: value -1.0 is out of range (allowed 0.001 .. 10 kg)"),
        ("value: 0.03584", "value: '1e-6'", "v.yaml: body.mass: value: value '1e-6'"),
        ("value: 0.03584", "value: true", "v.yaml: body.mass: value: value True"),
        ("value: 0.03584", "value: .nan", "v.yaml: body.mass: value nan is out of range (allowed 0.001 .. 10 kg)"),
        ("value: 0.03584", "value: .inf", "v.yaml: body.mass: value inf is out of range (allowed 0.001 .. 10 kg)"),
        ("value: 0.03584", "value: '0.03584'", "v.yaml: body.mass: value: value '0.03584'"),
        ("0.03584, unit: kg", "35.84, unit: g", "v.yaml: body.mass: value 35.84 has unit 'g', expected 'kg'"),
        ("value: 0.03584, unit: kg,", "value: 0.03584,", "v.yaml: body.mass: unit: is missing"),
        ("  mass:", "  mas:", "v.yaml: body.mas: unknown parameter, did you mean 'body.mass'?"),
        ("body:", "bodi:", "v.yaml: bodi.mass: unknown parameter"),
        ("{value: 0.03584,", "{value: 0.03584, colour: red,", "v.yaml: body.mass: colour: unknown key"),
        ("doc:", "title:", "v.yaml: doc: is missing"),
    ],
)  # fmt: skip
def test_a_faulty_vehicle_is_refused_in_one_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        model.load_vehicle(changed_vehicle(tmp_path, old, new))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_text_instead_of_a_number_is_answered_with_advice_and_range(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"write the number without them.*\(allowed 0\.001 \.\. 10 kg\)"):
        model.load_vehicle(changed_vehicle(tmp_path, "value: 0.03584", "value: '1e-6'"))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("common:", "comon:", "g.yaml: comon: unknown key"),
        ("    stiffness:", "    stifness:", "g.yaml: leg.stifness: unknown parameter, did you mean 'leg.stiffness'?"),
        ("designs:", "design:", "g.yaml: designs: expected a mapping"),
        ("  wide_short:\n    doc: Wide-Short\n", "  wide_short:\n", "g.yaml[wide_short]: doc: is missing"),
    ],
)
def test_a_faulty_gear_is_refused_in_one_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        model.load_gear("wide_short", changed_gear(tmp_path, old, new))
    assert message in str(caught.value)


def test_a_parameter_given_by_design_and_common_part_is_refused(tmp_path: Path) -> None:
    extra = '    leg:\n      stiffness: {value: 0.1, unit: N m/rad, source: "x"}\n'
    path = changed_gear(tmp_path, "  extra_narrow_short:\n    doc: Extra Narrow-Short\n    leg:\n",
                        f"  extra_narrow_short:\n    doc: Extra Narrow-Short\n{extra}")  # fmt: skip
    with pytest.raises(ConfigError, match=r"leg\.stiffness: value 0\.1 is given a second time"):
        model.load_gear("extra_narrow_short", path)


def test_a_parameter_given_by_vehicle_and_gear_is_refused(tmp_path: Path) -> None:
    path = changed_vehicle(tmp_path, "body:", 'leg:\n  mass: {value: 0.001, unit: kg, source: "x"}\nbody:')
    parts = (model.load_vehicle(path), model.load_gear("wide_short"))
    with pytest.raises(ConfigError, match=r"leg\.mass: value .* is also given by v\.yaml"):
        model.assemble(parts)


def test_a_required_parameter_that_nobody_gives_is_named() -> None:
    with pytest.raises(ConfigError, match=r"leg\.length is missing: neither vehicle nor gear gives it \(unit m\)"):
        model.assemble([model.load_vehicle("habas2021")])


@pytest.mark.parametrize("name", ["habas2020", "habas2021.yaml", "../habas2021"])
def test_an_unknown_vehicle_is_refused(name: str) -> None:
    with pytest.raises(ConfigError, match="vehicle"):
        model.load_vehicle(name)


def test_an_unknown_gear_is_answered_with_the_nearest_name() -> None:
    with pytest.raises(ConfigError, match=r"no gear 'wide_shrt', did you mean 'wide_short'"):
        model.load_gear("wide_shrt")


@pytest.mark.parametrize("value", [True, "0.01", "1e-2", None, float("nan"), -1.0, [0.01]])
def test_an_override_that_is_no_number_in_range_is_refused(value: object) -> None:
    with pytest.raises(ConfigError, match=r"override: sense\.latency: value .*allowed 0 \.\. 0\.1 s"):
        model.check_override("sense.latency", value)


def test_an_override_replaces_the_file_and_changes_the_digest() -> None:
    parts = (model.load_vehicle("habas2021"), model.load_gear("wide_short"))
    plain, changed = model.assemble(parts), model.assemble(parts, {"body.mass": 0.04})
    assert changed.values["body.mass"] == 0.04
    assert changed.origin["body.mass"] == "override"
    assert plain.digest() != changed.digest()
    assert plain.digest() == model.assemble(parts).digest()


@given(st.floats())
def test_a_mass_is_accepted_exactly_within_the_table_s_range(value: float) -> None:
    field = native.library().params["body.mass"]
    if field.lo <= value <= field.hi:
        assert model.check_override("body.mass", value) == value
    else:
        with pytest.raises(ConfigError):
            model.check_override("body.mass", value)


def test_vector_holds_the_values_in_table_order() -> None:
    parameters = model.assemble((model.load_vehicle("habas2021"), model.load_gear("wide_short")))
    index = list(native.library().params).index("body.mass")
    assert parameters.vector()[index] == 0.03584
    assert parameters.vector().dtype == np.float64
