"""A sample of the study of ends; `make ends-study` runs it over ten million landings."""

from collections import Counter

import numpy as np
import pytest
from ends_study import DEFECTS, LANDINGS_PER_VEHICLE, draw_overrides, draw_specs, draw_vehicle, study

from ivl import model, native
from ivl.world import START_CODES

SEED = 11


@pytest.fixture(scope="module")
def tally():
    return study(landings=8 * LANDINGS_PER_VEHICLE, seed=SEED, threads=2)


@pytest.mark.parametrize("end", DEFECTS)
def test_every_landing_of_every_vehicle_ends(tally, end):
    assert tally.count(end) == 0, tally.defects


def test_the_sample_is_not_trivial(tally):
    starts = Counter()
    for (_, start, _), n in tally.ends.items():
        starts[start] += n
    assert set(starts) == set(START_CODES)
    assert tally.count("contact_time") > 0.1 * tally.n_landings
    assert tally.count("refused") < 0.5 * tally.n_landings
    assert tally.n_vehicles == 8


def test_a_landing_depends_on_the_seed_and_its_number_alone():
    number = 3 * LANDINGS_PER_VEHICLE + 77
    alone = study(landings=1, seed=SEED, first=number)
    vehicle = draw_vehicle(SEED, 3)
    outcome = vehicle.native_model.rollouts(draw_specs(vehicle, SEED)[77:78], 1)
    assert alone.count(native.library().end_reason(int(outcome["end_reason"][0]))) == 1


def test_drawn_values_stay_in_the_range_that_the_model_allows():
    parts = (model.load_vehicle("crazyflie21"), model.load_gear("wide_long", "table1"))
    table = native.library().params
    for seed in range(20):
        drawn = draw_overrides(parts, np.random.default_rng(seed), far=bool(seed % 2))
        assert all(table[name].lo <= value <= table[name].hi for name, value in drawn.items())
