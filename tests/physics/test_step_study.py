"""A sample of the step-size study; `make step-study` runs it over ten thousand landings."""

import pytest
from step_study import study


@pytest.mark.slow
def test_number_of_stuck_feet_does_not_depend_on_the_step_except_at_the_edge_of_success():
    rows = study(landings=1200, seed=2, vehicle="habas2021")
    assert rows[-1].half < 0.01
    assert rows[-1].tenth < 0.01
    assert rows[-1].n_far == 0
    # and the sample is not trivial
    assert 0.1 < rows[-1].four_leg < 0.6
