"""Vehicles drawn from the sigmas of the files and from a section of a task."""

import json
import pickle
import re
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import yaml

from ivl import World, cli, experiment, family, landing, model, native, yamlfile
from ivl.errors import ConfigError, NativeError
from ivl.family import Family, FamilyChoice
from ivl.policy import general
from ivl.policy.flying import Drawn, Place, PolicyTask
from ivl.seeds import Purpose, derive

TRANSFER = "experiments/transfer.yaml"
BODY = {"body.mass": 0.0005, "rotor.tau_down": 0.01, "sense.latency": 0.003}


def vehicle(path: Path, **sigmas: float) -> str:
    """habas2021 with sigmas of some parameters, as a file."""
    data: dict[str, Any] = yaml.safe_load((model.VEHICLES_DIR / "habas2021.yaml").read_text())
    for name, sigma in sigmas.items():
        group, key = name.split(".")
        data[group][key]["sigma"] = sigma
    path.write_text(yaml.safe_dump(data))
    return str(path)


def is_allowed(world: World, mass_kg: float) -> bool:
    try:
        world.changed(**{"body.mass": mass_kg})
    except (ConfigError, NativeError):
        return False
    return True


@pytest.fixture
def world() -> World:
    return World("crazyflie21", "wide_short", "table1")


def test_a_world_knows_the_sigmas_of_its_files_less_those_that_are_overridden(world: World) -> None:
    assert {name: world.params.sigma[name] for name in BODY} == BODY
    assert world.params.sigma["leg.stiffness"] == 0.04
    assert "firmware.kp_att_xy" not in world.params.sigma
    assert "body.mass" not in World("crazyflie21", **{"body.mass": 0.035}).params.sigma
    changed = world.changed(**{"body.mass": 0.035})
    assert set(world.params.sigma) - set(changed.params.sigma) == {"body.mass"}
    again = changed.changed(**{"rotor.tau_up": 0.05})
    assert set(changed.params.sigma) - set(again.params.sigma) == {"rotor.tau_up"}
    assert World("habas2021").params.sigma.keys() == {"leg.stiffness", "leg.foot_damping"}
    assert World("habas2021", gear_set="as_simulated").params.sigma == {}


def test_a_sensor_set_takes_the_place_of_the_uncertain_sensing(world: World) -> None:
    assert "sense.latency" in world.params.sigma
    assert "sense.latency" not in World("crazyflie21", sensing="mocap").params.sigma


def test_values_have_the_mean_and_the_spread_of_the_files(world: World) -> None:
    drawn = family.members(world, 600, seed=3)
    for name, sigma in BODY.items():
        values = np.array([member.params.values[name] for member in drawn])
        assert abs(values.mean() - world.params.values[name]) < 4 * sigma / np.sqrt(600)
        assert values.std(ddof=1) == pytest.approx(sigma, rel=4 / np.sqrt(2 * 600))
    two = np.array([[m.params.values[name] for name in ("body.mass", "body.inertia_yy")] for m in drawn])
    assert abs(np.corrcoef(two.T)[0, 1]) < 4 / np.sqrt(600)


def test_a_value_out_of_range_is_drawn_again(world: World) -> None:
    """foot_damping is 0 +- 4e-4 and cannot be negative: half of a normal distribution, with its known mean."""
    values = np.array([m.params.values["leg.foot_damping"] for m in family.members(world, 600, seed=4)])
    assert (values > 0).all()
    assert values.mean() == pytest.approx(4e-4 * np.sqrt(2 / np.pi), rel=0.15)


def test_what_has_no_sigma_and_what_is_overridden_stays() -> None:
    world = World("crazyflie21", **{"body.mass": 0.035})
    uncertain = set(world.params.sigma)
    for member in family.members(world, 20, seed=5):
        same = {name for name, value in member.params.values.items() if value == world.params.values[name]}
        assert set(world.params.values) - same == uncertain


def test_a_seed_gives_the_same_members_and_more_of_them_begin_alike(world: World) -> None:
    first, again, other = (family.members(world, n, seed) for n, seed in ((5, 1), (8, 1), (5, 2)))
    digests = [[m.params.digest() for m in found] for found in (first, again, other)]
    assert digests[0] == digests[1][:5]
    assert not set(digests[1]) & set(digests[2])
    assert len(set(digests[1])) == 8


def test_a_member_is_drawn_from_no_further_and_can_be_pickled(world: World) -> None:
    (member,) = family.members(world, 1, seed=1)
    assert member.params.sigma == {}
    assert pickle.loads(pickle.dumps(member)).params.digest() == member.params.digest()
    with pytest.raises(ConfigError, match="vehicle crazyflie21, gear table1/wide_short: no parameter has a sigma"):
        family.members(member, 1, seed=1)


def test_a_vehicle_that_cannot_hover_is_drawn_again(tmp_path: Path) -> None:
    """Four motors lift 66 g: about one in fourteen of 36 +- 20 g is too heavy, and the library refuses it."""
    world = World(vehicle(tmp_path / "heavy.yaml", **{"body.mass": 0.02}), gear_set="as_simulated")
    p = world.params.values
    legs_kg = 4 * (p["leg.mass"] + p["leg.foot_mass"])
    limit_kg = 4 * p["rotor.thrust_max"] / p["world.gravity"] - legs_kg
    with pytest.raises(NativeError):
        world.changed(**{"body.mass": limit_kg + 1e-5})
    masses = [m.params.values["body.mass"] for m in family.members(world, 100, seed=1)]
    free = np.random.Generator(np.random.PCG64(1)).normal(p["body.mass"], 0.02, 400)
    assert (free[:100] > limit_kg).any()
    assert masses == [mass for mass in free if is_allowed(world, mass)][:100]
    assert 0.05 < max(masses) < limit_kg


def test_a_family_that_is_never_allowed_is_said(tmp_path: Path) -> None:
    world = World(vehicle(tmp_path / "v.yaml", **{"body.mass": 1e9}), gear_set="as_simulated")
    with pytest.raises(ConfigError, match=r"body\.mass: none of 1000 values is in range \(allowed .* kg\)"):
        family.members(world, 1, seed=1)


# a family with a section of its own


def section(**fields: Any) -> FamilyChoice:
    """A checked section; a spread and a correlation need no source here."""
    parameters = {name: {"source": "test", **spread} for name, spread in fields.pop("parameters", {}).items()}
    correlations = [{"source": "test", "of": list(of), "value": value} for *of, value in fields.pop("correlations", [])]
    found = yamlfile.validate(FamilyChoice, {**fields, "parameters": parameters, "correlations": correlations}, "test")
    found.check()
    return found


ALL_KNOWN = [f"{group}.*" for group in dict.fromkeys(name.partition(".")[0] for name in native.library().params)]


def only(world: World, **fields: Any) -> Family:
    """The family of nothing but the parameters of a section."""
    named = {name.partition(".")[0] for name in fields["parameters"]}
    files = [
        name for name in world.params.sigma if name.partition(".")[0] in named and name not in fields["parameters"]
    ]
    known = [group for group in ALL_KNOWN if group.partition(".")[0] not in named]
    return family.of(world, section(known=[*known, *files], **fields))


def drawn(kin: Family, n: int, seed: int) -> npt.NDArray[np.float64]:
    """Values of n members, shape (n, n_dimensions)."""
    return kin.values(kin.sample(n, seed).z)


def test_a_section_that_says_nothing_is_the_family_of_the_files(world: World) -> None:
    digests = [[m.params.digest() for m in family.members(world, 4, 1, choice)] for choice in (None, FamilyChoice())]
    assert digests[0] == digests[1]


def test_members_have_the_values_that_z_stands_for(world: World) -> None:
    kin = family.of(world, section(parameters={"leg.damping": {"share": 0.2}}))
    sample = kin.sample(5, seed=2)
    for member, values in zip(sample.worlds, kin.values(sample.z), strict=True):
        assert [member.params.values[name] for name in kin.names] == values.tolist()
    z, one = kin.draw(np.random.Generator(np.random.PCG64(2)))
    assert np.array_equal(z, sample.z[0])
    assert one.params.digest() == sample.worlds[0].params.digest()


@pytest.mark.parametrize("scale", [0.5, 1.0, 2.0])
def test_a_sigma_and_a_share_have_their_spread_times_the_scale(world: World, scale: float) -> None:
    spreads = {"body.mass": {"share": 0.02}, "rotor.tau_up": {"sigma": 0.004}, "leg.damping": {"share": 0.05}}
    kin = only(world, parameters=spreads, scale=scale)
    values, centre = drawn(kin, 800, seed=7), world.params.values
    sigma = {"body.mass": 0.02 * 0.0343, "rotor.tau_up": 0.004, "leg.damping": 0.05 * centre["leg.damping"]}
    assert kin.names == ("body.mass", "leg.damping", "rotor.tau_up")
    for name, column in zip(kin.names, values.T, strict=True):
        assert abs(column.mean() - centre[name]) < 4 * scale * sigma[name] / np.sqrt(800)
        assert column.std() == pytest.approx(scale * sigma[name], rel=4 / np.sqrt(2 * 800))


def test_a_section_replaces_the_sigma_of_a_file_and_adds_parameters_without_one(world: World) -> None:
    before = {d.name: d for d in family.of(world).dimensions}
    spreads = {"body.mass": {"sigma": 0.001}, "plate.friction": {"share": 0.1}}
    kin = {d.name: d for d in family.of(world, section(parameters=spreads)).dimensions}
    assert set(kin) == {*before, "plate.friction"}
    assert (before["body.mass"].sigma, kin["body.mass"].sigma, kin["body.mass"].source) == (0.0005, 0.001, "test")
    assert kin["plate.friction"].sigma == pytest.approx(0.1 * world.params.values["plate.friction"])
    assert before["body.mass"].source == "sigma of crazyflie21.yaml"
    assert all(kin[name] == before[name] for name in before if name != "body.mass")


def test_a_log_uniform_parameter_is_as_likely_in_each_factor(world: World) -> None:
    lo, hi = 1e-5, 5e-4
    values = drawn(only(world, parameters={"leg.foot_damping": {"log_uniform": [lo, hi]}}), 1000, seed=3)[:, 0]
    assert ((lo <= values) & (values <= hi)).all()
    counts, _ = np.histogram(np.log(values), bins=10, range=(np.log(lo), np.log(hi)))
    assert counts.sum() == 1000
    assert np.abs(counts - 100).max() < 4 * np.sqrt(90)


@pytest.mark.parametrize("value", [-0.9, 0.6])
def test_two_parameters_are_correlated_as_the_section_says_and_others_are_not(world: World, value: float) -> None:
    spreads = {name: {"share": 0.05} for name in ("body.mass", "rotor.tau_down", "rotor.tau_up")}
    kin = only(world, parameters=spreads, correlations=[("rotor.tau_up", "rotor.tau_down", value)])
    found = np.corrcoef(drawn(kin, 1500, seed=5).T)
    expected = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, value], [0.0, value, 1.0]])
    assert np.abs(found - expected).max() < 4 / np.sqrt(1500)
    assert np.allclose(kin.correlations, expected)


def test_a_correlated_pair_out_of_bounds_is_drawn_again_as_a_pair(world: World) -> None:
    """Against plain rejection: the quarter of a bivariate normal distribution where both are above their centres."""
    tau_up, tau_down = (world.params.values[name] for name in ("rotor.tau_up", "rotor.tau_down"))
    spreads = {
        "rotor.tau_down": {"share": 0.05, "bounds": [tau_down, 1.0]},
        "rotor.tau_up": {"share": 0.05, "bounds": [tau_up, 1.0]},
    }
    kin = only(world, parameters=spreads, correlations=[("rotor.tau_up", "rotor.tau_down", -0.8)])
    x = drawn(kin, 1500, seed=6) / (tau_down, tau_up) / 0.05 - 20.0
    free = np.random.Generator(np.random.PCG64(1)).multivariate_normal([0, 0], [[1, -0.8], [-0.8, 1]], 200_000)
    free = free[(free > 0).all(axis=1)]
    assert np.abs(x.mean(axis=0) - free.mean(axis=0)).max() < 4 * free.std() / np.sqrt(1500)
    assert abs((x[:, 0] * x[:, 1]).mean() - free.prod(axis=1).mean()) < 4 * free.prod(axis=1).std() / np.sqrt(1500)


def test_what_is_known_is_not_drawn_nor_is_what_an_override_sets(world: World) -> None:
    names = set(family.of(world).names)
    known = family.of(world, section(known=["aero.*", "body.mass"]))
    assert names - set(known.names) == {n for n in names if n.startswith("aero.")} | {"body.mass"}
    overridden = world.changed(**{"rotor.tau_up": 0.06})
    choice = section(
        parameters={"rotor.tau_up": {"share": 0.3}}, correlations=[("rotor.tau_up", "rotor.tau_down", 0.5)]
    )
    kin = family.of(overridden, choice)
    assert "rotor.tau_up" not in kin.names
    assert np.array_equal(kin.root, np.eye(len(kin.names)))
    assert {m.params.values["rotor.tau_up"] for m in kin.sample(3, 0).worlds} == {0.06}


def test_every_value_is_inside_its_bounds_whatever_the_section_says(world: World) -> None:
    """Random sections: spreads of all three kinds, narrow and one-sided bounds, correlations, scales."""
    rng = np.random.Generator(np.random.PCG64(20))
    table, centre = native.library().params, world.params.values
    names = [
        "body.mass", "rotor.tau_up", "rotor.tau_down", "leg.damping", "plate.friction", "sense.latency", "aero.drag_z",
        "battery.sag", "leg.stiffness",
    ]  # fmt: skip
    for _ in range(15):
        spreads: dict[str, dict[str, Any]] = {}
        for name in rng.permutation(names)[: rng.integers(2, len(names))].tolist():
            lo, hi = sorted(centre[name] * rng.uniform(0.7, 1.3, 2))
            lo, hi = max(lo, table[name].lo), min(hi, table[name].hi)
            kind = rng.integers(3)
            spread = {"sigma": 0.2 * centre[name]} if kind else {"share": float(rng.uniform(0.05, 1.0))}
            spread |= {"bounds": [lo, hi] if rng.random() < 0.5 else [0.9 * centre[name], table[name].hi]}
            spreads[name] = spread if kind < 2 else {"log_uniform": [lo, hi]}
        pair = (*list(spreads)[:2], float(rng.uniform(-0.9, 0.9)))
        kin = family.of(world, section(parameters=spreads, correlations=[pair], scale=float(rng.uniform(0.3, 3.0))))
        sample = kin.sample(5, seed=int(rng.integers(1000)))
        assert kin.inside(sample.z).all()
        for member in sample.worlds:
            for name, spread in spreads.items():
                lo, hi = spread.get("bounds") or spread["log_uniform"]
                assert lo <= member.params.values[name] <= hi
            assert all(table[name].lo <= member.params.values[name] <= table[name].hi for name in kin.names)


def test_a_member_that_the_library_refuses_is_counted(tmp_path: Path) -> None:
    world = World(vehicle(tmp_path / "heavy.yaml", **{"body.mass": 0.02}), gear_set="as_simulated")
    kin, sample = family.of(world), family.of(world).sample(100, seed=1)
    x = np.random.Generator(np.random.PCG64(1)).standard_normal(400)
    free = [mass for mass in kin.values(x[:, None])[:, 0] if mass >= kin.dimensions[0].lo]
    allowed = np.cumsum([is_allowed(world, mass) for mass in free])
    assert sample.n_refused == int(np.searchsorted(allowed, 100)) + 1 - 100 > 0
    assert sample.share_refused == sample.n_refused / (100 + sample.n_refused)


@pytest.mark.parametrize(
    ("fields", "complaint"),
    [
        ({"parameters": {"body.mas": {"share": 0.1}}}, r"family\.parameters: body\.mas: unknown .* 'body\.mass'"),
        ({"parameters": {"body.mass": {}}}, r"parameters\.body\.mass: .*give one of sigma, share, .*given: none"),
        ({"parameters": {"body.mass": {"share": 0.1, "sigma": 1.0}}}, "give one of .*given: sigma, share"),
        ({"parameters": {"body.mass": {"share": 1.5}}}, r"parameters\.body\.mass\.share: value 1\.5: .*equal to 1"),
        ({"parameters": {"body.mass": {"sigma": -1.0}}}, r"body\.mass\.sigma: value -1\.0: .*greater than 0"),
        ({"parameters": {"body.mass": {"log_uniform": [0.0, 1.0]}}}, "log_uniform: 0 must be above 0"),
        ({"parameters": {"body.mass": {"log_uniform": [0.2, 0.1]}}}, r"log_uniform: 0\.2 must be below 0\.1"),
        ({"parameters": {"body.mass": {"share": 0.1, "bounds": [1.0, 1.0]}}}, "bounds: 1 must be below 1"),
        (
            {"parameters": {"rotor.tau_up": {"share": 0.1, "bounds": [-1.0, 0.05]}}},
            r"family\.parameters\.rotor\.tau_up\.bounds: value \[-1\.0, 0\.05\] .*\(allowed 1e-06 \.\. 1 s\)",
        ),
        (
            {"parameters": {"leg.foot_damping": {"log_uniform": [1e-5, 1e9]}}},
            r"family\.parameters\.leg\.foot_damping\.log_uniform: value .*\(allowed 0 \.\. .* N m s/rad\)",
        ),
        ({"known": ["bod.*"]}, r"family\.known: bod\.\*: unknown parameter"),
        ({"known": ["body.mass"], "parameters": {"body.mass": {"share": 0.1}}}, r"parameters\.body\.mass: .*`known`"),
        ({"known": ["body.*"], "parameters": {"body.mass": {"share": 0.1}}}, r"parameters\.body\.mass: .*`known`"),
        ({"correlations": [("body.mass", "body.mas", 0.5)]}, r"family\.correlations: .*body\.mas: unknown parameter"),
        ({"correlations": [("body.mass", "body.mass", 0.5)]}, "body.mass and body.mass: is one parameter"),
        (
            {"correlations": [("body.mass", "rotor.tau_up", 0.5), ("rotor.tau_up", "body.mass", 0.4)]},
            "are given twice",
        ),
        ({"correlations": [("body.mass", "rotor.tau_up", 1.0)]}, r"correlations\.0\.value: .*less than 1"),
        ({"scale": 0.0}, r"scale: value 0\.0: .*greater than 0"),
        ({"scale": 11.0}, r"scale: value 11\.0: .*equal to 10"),
    ],
)  # fmt: skip
def test_a_section_that_is_wrong_is_said_in_one_line(fields: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ConfigError, match=complaint) as caught:
        section(**fields)
    assert "\n" not in str(caught.value)


def test_what_only_the_world_shows_to_be_wrong_is_said(world: World) -> None:
    for choice, complaint in (
        (section(correlations=[("body.mass", "rotor.x", 0.5)]), r"family\.correlations: rotor\.x: is not drawn"),
        (section(parameters={"leg.foot_damping": {"share": 0.1}}), r"leg\.foot_damping: its centre is 0 .* above 0"),
        (section(parameters={"leg.adhesion": {"share": 0.1}}), r"leg\.adhesion: its centre is inf N: only log_uniform"),
        (section(known=ALL_KNOWN), "no parameter has a sigma"),
        (
            section(correlations=[(a, b, v) for a, b, v in zip(("body.mass", "body.mass", "rotor.tau_up"),
                    ("rotor.tau_up", "rotor.tau_down", "rotor.tau_down"), (0.9, 0.9, -0.9), strict=True)]),
            "contradict each other",
        ),
    ):  # fmt: skip
        with pytest.raises(ConfigError, match=complaint):
            family.of(world, choice)
    never = section(parameters={"body.mass": {"sigma": 1e-6, "bounds": [0.05, 0.06]}})
    with pytest.raises(
        ConfigError, match=r"body\.mass: none of 1000 values is in range \(allowed 0\.05 \.\. 0\.06 kg\)"
    ):
        family.of(world, never).sample(1, 0)


# the section in tasks and commands


def test_a_setting_reaches_into_the_section_by_the_name_of_a_parameter() -> None:
    settings = ["family.scale=2.0", "family.parameters.body.mass.share=0.1", "family.known=[aero.*]"]
    chosen = experiment.load(TRANSFER, settings)
    assert chosen.family.scale == 2.0
    assert chosen.family.known == ["aero.*"]
    assert chosen.family.parameters["body.mass"].share == 0.1
    assert landing.of_rollout(chosen, 0, (4.0, 8.0), 0).family == chosen.trial(0).family
    with pytest.raises(ConfigError, match=r"transfer\.yaml: family\.scal: unknown key, did you mean 'family\.scale'"):
        experiment.load(TRANSFER, ["family.scal=2.0"])
    with pytest.raises(ConfigError, match=r"transfer\.yaml: family\.known: bdy\.\*: unknown parameter"):
        experiment.load(TRANSFER, ["family.known=['bdy.*']"])


def test_members_that_fly_may_have_values_that_no_learner_knows() -> None:
    settings = ["family.member=3", "family.member_overrides={aero.drag_z: 0.05, leg.length: 0.04}"]
    odd, plain = experiment.load(TRANSFER, settings), experiment.load(TRANSFER, settings[:1])
    odd_values, plain_values = (one.make_world().params.values for one in (odd, plain))
    differs = {name for name, value in plain_values.items() if odd_values[name] != value}
    assert differs == {"aero.drag_z", "leg.length"}
    assert (odd_values["aero.drag_z"], odd_values["leg.length"]) == (0.05, 0.04)
    kin = family.of(odd.nominal_world_of(odd.gear), odd.family)
    assert kin.world.params.values["aero.drag_z"] != 0.05
    assert kin.draw(np.random.default_rng(0))[1].params.values["leg.length"] == kin.world.params.values["leg.length"]


@pytest.mark.parametrize(
    ("overrides", "complaint"),
    [
        ("{leg.length: 9.0}", "family.member_overrides.leg.length: value 9 is out of range (allowed "),
        ("{leg.lenth: 0.1}", "family.member_overrides: leg.lenth: unknown parameter, did you mean 'leg.length'?"),
    ],
)
def test_a_wrong_value_of_the_members_that_fly_is_said(overrides: str, complaint: str) -> None:
    with pytest.raises(ConfigError) as error:
        experiment.load(TRANSFER, ["family.member=3", f"family.member_overrides={overrides}"]).make_world()
    assert complaint in str(error.value)
    assert len(str(error.value).splitlines()) == 1


def test_the_family_changes_nothing_of_the_world_that_is_flown() -> None:
    choices = [experiment.load(TRANSFER, ["family.member=null", *s]) for s in ([], ["family.scale=3.0"])]
    worlds = [chosen.make_world() for chosen in choices]
    paper = experiment.load("experiments/paper_flight.yaml")
    assert worlds[0].params == worlds[1].params == paper.make_world().params
    assert choices[0].family == paper.family


def test_the_family_of_transfer_is_what_is_drawn() -> None:
    chosen = experiment.load(TRANSFER)
    kin = family.of(chosen.nominal_world_of(chosen.gear), chosen.family)
    assert set(kin.names) == set(chosen.family.parameters)
    assert kin.sample(20, 0).share_refused < 0.2


def test_the_drawn_vehicles_of_a_policy_task_are_of_its_family() -> None:
    task = {"vehicle": "crazyflie21", "gear": "wide_short", "gear_set": "table1"}
    choice = section(parameters={"rotor.thrust_gain": {"share": 0.01}}, known=["body.*"])
    places = Place.of(PolicyTask(**task, family=choice)).members(Drawn(n_vehicles=3, seed=1), Purpose.FAMILY)
    expected = family.members(World(**task), 3, derive(1, Purpose.FAMILY), choice)
    assert [p.world.params.digest() for p in places] == [w.params.digest() for w in expected]
    chosen = general.load(["experiments/general.yaml"], ["family.scale=2.0", "drawn.n_vehicles=3"])
    assert ([t.family.scale for t in chosen.tasks], chosen.drawn) == ([2.0], Drawn(n_vehicles=3))


def shown(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    assert cli.run(["family", "show", *arguments, "--json"]) == 0
    return dict(json.loads(capsys.readouterr().out))


def test_family_show_tells_what_is_drawn_and_draws_it(capsys: pytest.CaptureFixture[str]) -> None:
    found = shown(capsys, TRANSFER, "--set", "family.scale=2.0", "--members", "4", "--seed", "3")
    chosen = experiment.load(TRANSFER, ["family.scale=2.0"])
    kin = family.of(chosen.nominal_world_of(chosen.gear), chosen.family)
    sample = kin.sample(4, 3)
    assert list(found["parameters"]) == list(kin.names)
    assert found["parameters"]["body.mass"]["sigma"] == pytest.approx(2 * 0.03 * 0.0343)
    assert (found["parameters"]["leg.foot_damping"]["sigma"], found["parameters"]["leg.foot_damping"]["hi"]) == (
        None,
        5e-4,
    )
    assert found["members"]["values"]["body.mass"] == [w.params.values["body.mass"] for w in sample.worlds]
    assert (found["members"]["n"], found["members"]["n_refused"]) == (4, sample.n_refused)
    assert found == shown(
        capsys, "--experiment", TRANSFER, "--set", "family.scale=2.0", "--members", "4", "--seed", "3"
    )
    assert cli.run(["family", "show", TRANSFER, "--members", "9"]) == 0
    text = capsys.readouterr().out
    for name, spread in chosen.family.parameters.items():
        assert re.search(rf"^{re.escape(name)} .* {re.escape(spread.source)}$", text, re.MULTILINE)
    assert "9 drawn; the library refused" in text


def test_family_show_takes_vehicle_gear_and_sensors(capsys: pytest.CaptureFixture[str]) -> None:
    found = shown(capsys, "--vehicle", "crazyflie21", "--gear", "wide_long", "--sensors", "mocap")
    world = World("crazyflie21", "wide_long", "table1", "mocap")
    assert set(found["parameters"]) == set(world.params.sigma)
    assert (found["vehicle"], found["gear"], found["sensing"]) == ("crazyflie21", "wide_long", "mocap")
    assert "members" not in found
    correlation = "family.correlations=[{of: [rotor.tau_up, rotor.tau_down], value: 0.5, source: test}]"
    found = shown(capsys, "--vehicle", "crazyflie21", "--set", "body.mass=0.035", "--set", correlation)
    assert "body.mass" not in found["parameters"]
    assert found["correlations"] == [{"of": ["rotor.tau_up", "rotor.tau_down"], "value": 0.5, "source": "test"}]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--vehicle", "habas2021", "--gear-set", "as_simulated"], "no parameter has a sigma"),
        ([TRANSFER, "--experiment", TRANSFER], f"the experiment is already {TRANSFER}"),
        ([TRANSFER, "--seed", "1"], "--seed: is for --members"),
        ([TRANSFER, "--members", "-1"], "--members"),
        (["experiments/transfr.yaml"], "no such file"),
        ([TRANSFER, "--set", "family.scale=20.0"], "family.scale: value 20.0"),
        (["--set", "family.known=['zzz.*']"], "options: family.known: zzz.*: unknown parameter"),
    ],
)
def test_family_show_says_what_is_wrong_in_one_line(
    arguments: list[str], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.run(["family", "show", *arguments]) == 2
    printed = capsys.readouterr()
    assert complaint in printed.err
    assert (printed.out, printed.err.count("\n")) == ("", 1)


def test_a_task_flies_the_member_that_it_names(capsys: pytest.CaptureFixture[str]) -> None:
    settings = ["family.member=2", "family.seed=4"]
    chosen = experiment.load(TRANSFER, settings)
    nominal = chosen.nominal_world_of(chosen.gear)
    assert nominal.params == experiment.load("experiments/paper_flight.yaml").make_world().params
    expected = family.members(nominal, 3, 4, chosen.family)[2]
    assert chosen.make_world().params.digest() == expected.params.digest() != nominal.params.digest()
    assert chosen.nominal_world_of(chosen.gear).params == nominal.params
    spec = landing.of_rollout(chosen, 0, (4.0, 8.0), 3)
    assert spec.fly()[1].rows.tobytes() == spec.fly(expected)[1].rows.tobytes() != spec.fly(nominal)[1].rows.tobytes()
    told = shown(capsys, TRANSFER, "--set", "family.member=2", "--set", "family.seed=4", "--members", "3")["members"]
    assert {name: values[2] for name, values in told["values"].items()} == {
        name: expected.params.values[name] for name in told["values"]
    }
    with pytest.raises(ConfigError, match=r"family\.member: value 10000: .*allowed 0 \.\. 9999"):
        experiment.load(TRANSFER, ["family.member=10000"])
