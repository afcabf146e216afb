"""Vehicles drawn from the sigmas of the files."""

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from ivl import World, family, model
from ivl.errors import ConfigError, NativeError

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
