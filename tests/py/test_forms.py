"""Forms of policies on the host: units, ranges, checksums, and every place where a policy is spelled."""

import zlib
from typing import Any

import numpy as np
import pytest

import ivl
from ivl import experiment, forms, landing, native, yamlfile
from ivl.cli.policy_options import theta_of
from ivl.errors import ArgumentError, ConfigError, NativeError
from ivl.forms import Form, Parameter
from ivl.landing import LandingSpec

NAMES = ("rrev_c_per_s", "moment_y_Nmm")
TASK = {"speed_mps": 2.5, "angle_deg": 90.0}


@pytest.fixture
def paper() -> Form:
    return forms.by_name(forms.PAPER)


# ---- the form itself


def test_the_form_is_that_of_the_flight_cores_table(paper: Form) -> None:
    assert (paper.number, paper.name, paper.n, paper.names) == (0, "constant", 2, NAMES)
    assert [(p.symbol, p.unit, p.si, p.lo, p.hi) for p in paper.params] == [
        ("RREV_c", "1/s", 1.0, 0.0, 20.0),
        ("M_yd", "N mm", 1e-3, 0.0, 20.0),
    ]
    assert all(p.doc for p in paper.params)


def test_units_become_si_with_the_bits_of_one_product(paper: Form) -> None:
    theta = np.random.default_rng(1).uniform(0.0, 20.0, (100, 3, 2))
    si = paper.to_si(theta)
    assert si.dtype == np.float64
    assert si.tobytes() == np.stack([theta[..., 0] * 1.0, theta[..., 1] * 1e-3], axis=-1).tobytes()
    assert paper.to_si([20.0, 20.0]).tolist() == [20.0, 0.02]
    assert paper.to_si([[0, 0]]).tolist() == [[0.0, 0.0]], "whole numbers are numbers"


@pytest.mark.parametrize("place", [0, 1])
@pytest.mark.parametrize("value", [-1e-9, 20.000001, np.nan, np.inf, -np.inf])
def test_a_value_out_of_range_is_told_by_form_and_parameter(paper: Form, place: int, value: float) -> None:
    theta = np.full((3, 2), 5.0)
    theta[1, place] = value
    with pytest.raises(ArgumentError) as caught:
        paper.to_si(theta)
    unit = ("1/s", "N mm")[place]
    assert str(caught.value) == (
        f"form constant: {NAMES[place]}: value {value!r} is out of range (allowed 0 .. 20 {unit})"
    )


@pytest.mark.parametrize("theta", [[4.8], [4.8, 8.0, 1.0], 4.8, [], np.zeros((2, 3))])
def test_another_number_of_parameters_is_refused(paper: Form, theta: Any) -> None:
    with pytest.raises(ArgumentError, match=r"form constant has 2 parameters \(rrev_c_per_s, moment_y_Nmm\), not an"):
        paper.to_si(theta)


def test_checksum_is_that_of_name_and_floats(paper: Form) -> None:
    rng = np.random.default_rng(2)
    for theta in rng.uniform(0.0, 20.0, (50, 2)):
        said = b"constant" + (theta * np.array([1.0, 1e-3])).astype("<f4").tobytes()
        assert paper.crc(theta) == zlib.crc32(said)
    assert paper.crc([4.5, 8.0]) == 0x43BB9AD1, "the number that the flight core's own test knows"


def test_a_policy_as_people_read_it(paper: Form) -> None:
    assert paper.describe([4.80000001, 8]) == "RREV_c 4.8 1/s, M_yd 8 N mm"
    with pytest.raises(ValueError, match="zip"):
        paper.describe([4.8])


@pytest.mark.parametrize(
    ("symbol", "label"),
    [("M_yd", "$M$$_{yd}$ (N mm)"), ("RREV_c", "RREV$_{c}$ (N mm)"), ("M", "$M$ (N mm)"), ("RREV", "RREV (N mm)")],
)
def test_label_of_an_axis(symbol: str, label: str) -> None:
    assert Parameter("a", symbol, "N mm", 1e-3, 0.0, 1.0, "").label == label


def test_a_form_that_does_not_exist_is_told_which_there_are(paper: Form) -> None:
    assert forms.by_name("constant") is paper
    with pytest.raises(ArgumentError, match=r"policy form 'linear' is unknown \(allowed constant, polynomial2"):
        forms.by_name("linear")


# ---- arguments of rollouts


def test_parameters_may_come_in_order_by_name_or_both() -> None:
    world = ivl.World("habas2021", "wide_short", "as_simulated")
    moments = np.array([6.0, 8.0])
    wanted = world.rollouts(2.5, 90.0, 4.8, moments).tobytes()
    assert world.rollouts(2.5, 90.0, rrev_c_per_s=4.8, moment_y_Nmm=moments).tobytes() == wanted
    assert world.rollouts(2.5, 90.0, moment_y_Nmm=moments, rrev_c_per_s=4.8).tobytes() == wanted
    assert world.rollouts(2.5, 90.0, 4.8, moment_y_Nmm=moments, form="constant").tobytes() == wanted
    trace = world.trace(2.5, 90.0, 4.8, moment_y_Nmm=8.0, stream=1)
    assert trace.outcome.tobytes() == world.rollouts(2.5, 90.0, 4.8, moments)[1].tobytes()


@pytest.mark.parametrize(
    ("theta", "named", "message"),
    [
        ((4.8,), {}, "given are 1 in order"),
        ((), {"rrev_c_per_s": 4.8}, "given are 0 in order, rrev_c_per_s"),
        ((4.8, 8.0, 1.0), {}, "given are 3 in order"),
        ((4.8, 8.0), {"moment_y_Nmm": 8.0}, "given are 2 in order, moment_y_Nmm"),
        ((4.8,), {"moment_y_Nm": 8.0}, "given are 1 in order, moment_y_Nm"),
    ],
)
def test_parameters_that_are_not_those_of_the_form_are_refused(
    world: ivl.World, theta: tuple[float, ...], named: dict[str, float], message: str
) -> None:
    with pytest.raises(ArgumentError) as caught:
        world.rollouts(2.5, 90.0, *theta, **named)
    assert str(caught.value).startswith("a policy of the form constant has the parameters rrev_c_per_s, moment_y_Nmm")
    assert str(caught.value).endswith(message)


def test_parameters_broadcast_and_say_so_when_they_cannot(world: ivl.World) -> None:
    assert world.rollouts(2.5, 90.0, np.full((3, 1), 4.8), np.full(2, 8.0)).shape == (3, 2)
    with pytest.raises(ArgumentError, match=r"do not broadcast: rrev_c_per_s \(2,\), moment_y_Nmm \(3,\)"):
        world.rollouts(2.5, 90.0, [4.8, 4.9], [7.0, 8.0, 9.0])


# ---- one landing


def test_a_landing_takes_theta_or_named_parameters() -> None:
    by_theta = LandingSpec(**TASK, theta=[4.8, 8.0])
    by_name = LandingSpec(**TASK, moment_y_Nmm=8.0, rrev_c_per_s=4.8)
    assert by_theta == by_name
    assert by_name.theta == [4.8, 8.0]
    assert by_theta.fly()[1].outcome.tobytes() == by_name.fly()[1].outcome.tobytes()


@pytest.mark.parametrize(
    ("policy", "message"),
    [
        ({}, "theta: is missing"),
        ({"rrev_c_per_s": 4.8}, "moment_y_Nmm: is missing (the form constant has rrev_c_per_s, moment_y_Nmm)"),
        ({"theta": [4.8, 8.0], "moment_y_Nmm": 8.0}, "theta: already given by moment_y_Nmm"),
        ({"theta": [4.8]}, "a policy of the form constant has 2 parameters"),
        ({"theta": [4.8, 30.0]}, "form constant: moment_y_Nmm: value 30.0 is out of range (allowed 0 .. 20 N mm)"),
        ({"theta": [4.8, 8.0], "form": "linear"}, "policy form 'linear' is unknown (allowed constant, polynomial2"),
        ({"theta": [4.8, 8.0], "flip_Nmm": 8.0}, "flip_Nmm: unknown key"),
    ],
)
def test_a_landing_with_a_wrong_policy_is_refused_in_one_line(
    policy: dict[str, Any], message: str, tmp_path: Any
) -> None:
    path = tmp_path / "landing.yaml"
    path.write_text(yamlfile.dump({**TASK, **policy}))
    with pytest.raises(ConfigError) as caught:
        landing.load(path)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


# ---- the section `policy:` of an experiment

AXIS = {"mu0": 5.0, "sigma0": 1.0, "bounds": [0.0, 7.0]}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"moment_y_Nmm": None},
            "policy.moment_y_Nmm: must be given (the form constant has rrev_c_per_s, moment_y_Nmm)",
        ),
        ({"flip_Nmm": AXIS}, "policy.flip_Nmm: no such field (the form constant has rrev_c_per_s, moment_y_Nmm)"),
        ({"form": "linear"}, "policy form 'linear' is unknown (allowed constant, polynomial2"),
        ({"form": 3}, "policy.form: value 3"),
        ({"moment_y_Nmm": 8.0}, "policy.moment_y_Nmm: value 8.0"),
        ({"moment_y_Nmm": {**AXIS, "mu": 1.0}}, "policy.moment_y_Nmm.mu: unknown key"),
        ({"moment_y_Nmm": {"mu0": 5.0, "sigma0": 1.0}}, "policy.moment_y_Nmm.bounds: is missing"),
        (
            {"moment_y_Nmm": {**AXIS, "bounds": [0.0, 21.0]}},
            "policy.moment_y_Nmm.bounds: [0, 21] (the form constant allows within 0 .. 20 N mm)",
        ),
        ({"moment_y_Nmm": {**AXIS, "bounds": [7.0, 0.0]}}, "policy.moment_y_Nmm.bounds: [7, 0]"),
        (
            {"moment_y_Nmm": {**AXIS, "mu0": 7.5}},
            "policy.moment_y_Nmm.mu0: value 7.5 is out of range (allowed 0 .. 7 N mm)",
        ),
    ],
)
def test_a_wrong_policy_section_is_refused_in_one_line(
    small_data: dict[str, Any], change: dict[str, Any], message: str
) -> None:
    policy = {**small_data["policy"], **change}
    small_data["policy"] = {name: value for name, value in policy.items() if value is not None}
    with pytest.raises(ConfigError) as caught:
        experiment.from_data(small_data, "small.yaml")
    assert str(caught.value).startswith("small.yaml: ")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_form_of_a_policy_is_written_out(small_data: dict[str, Any]) -> None:
    chosen = experiment.from_data(small_data, "small.yaml")
    assert chosen.policy.shape is forms.by_name("constant")
    assert yamlfile.parse(chosen.to_yaml(), "")["policy"]["form"] == "constant"
    assert chosen.policy.mu0 == [4.8, 8.0]


# ---- options of the command line


@pytest.mark.parametrize(
    ("theta", "rrev", "moment", "wanted"),
    [("4.8,8", None, None, [4.8, 8.0]), (None, 4.8, 8.0, [4.8, 8.0]), (" 1e0 , 0.5", None, None, [1.0, 0.5])],
)
def test_options_say_the_papers_policy_in_two_ways(
    theta: str | None, rrev: float | None, moment: float | None, wanted: list[float]
) -> None:
    assert theta_of("constant", theta, rrev, moment) == wanted


@pytest.mark.parametrize(
    ("name", "theta", "rrev", "moment", "message"),
    [
        ("constant", None, 4.8, None, "--moment is missing"),
        ("constant", None, None, None, "--rrev is missing"),
        ("constant", "4.8,8", 4.8, None, "--theta: already given by --rrev"),
        ("constant", "4.8,8", None, 8.0, "--theta: already given by --moment"),
        ("constant", "4.8", None, None, "policy: a policy of the form constant has 2 parameters"),
        ("constant", "4.8,x", None, None, "--theta 4.8,x: numbers with commas between them are needed"),
        ("constant", "", None, None, "--theta : numbers with commas between them are needed"),
        ("constant", "4.8,nan", None, None, "policy: form constant: moment_y_Nmm: value nan is out of range"),
        ("constant", None, 4.8, 21.0, "policy: form constant: moment_y_Nmm: value 21.0 is out of range"),
        ("linear", "1,2", None, None, "policy: policy form 'linear' is unknown (allowed constant, polynomial2"),
    ],
)
def test_options_that_say_no_policy_are_refused(
    name: str, theta: str | None, rrev: float | None, moment: float | None, message: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        theta_of(name, theta, rrev, moment)
    assert str(caught.value).startswith(message)


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("limit", "a word of SQL"),
        ("speed_mps", "taken"),
        ("Seed", "taken"),
        ("trial", "taken"),
        ("a b", "no word"),
        ("", "no word"),
        ("1st", "no word"),
    ],
)
def test_a_parameter_whose_name_can_be_no_column_is_refused(name: str, why: str) -> None:
    parameter = forms.Parameter(name, "x", "1", 1.0, 0.0, 1.0, "a test")
    with pytest.raises(NativeError, match=why):
        forms._check_names(forms.Form(9, "own", "a test", (parameter,)))


def test_two_parameters_of_one_name_are_refused() -> None:
    twice = tuple(forms.Parameter(name, "x", "1", 1.0, 0.0, 1.0, "a test") for name in ("gain", "Gain"))
    with pytest.raises(NativeError, match="'Gain': it is taken"):
        forms._check_names(forms.Form(9, "own", "a test", twice))


def test_a_range_ends_where_its_source_says() -> None:
    field = native.Field(
        "gain", "f4", 0, 1, "d", float(np.float32(0.1)), float(np.float32(0.3)), float(np.float32(0.1)), ""
    )
    parameter = forms._parameter("g", field)
    assert (parameter.lo, parameter.hi, parameter.si) == (1.0, 3.0, 0.1)
