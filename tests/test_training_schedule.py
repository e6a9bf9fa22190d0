"""When a run does what, against the numbers that 3DGS publishes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.training.schedule import Schedule

lengths = st.integers(1, 100_000)


def times(schedule, what):
    return [i for i in range(1, schedule.iterations + 1) if getattr(schedule, what)(i)]


def test_thirty_thousand_iterations_are_scheduled_as_3dgs_does():
    schedule = Schedule.scaled(30_000)
    assert times(schedule, "densifies") == list(range(600, 15_000, 100))
    assert times(schedule, "resets_opacities") == [3000, 6000, 9000, 12_000]
    assert [schedule.sh_degree(i) for i in (1, 999, 1000, 2000, 3000, 30_000)] == [0, 0, 1, 2, 3, 3]
    assert not schedule.prunes_big(3000)
    assert schedule.prunes_big(3100)


def test_a_short_run_scales_its_schedule():
    schedule = Schedule.scaled(3000)
    assert times(schedule, "densifies") == list(range(200, 1500, 50))
    assert times(schedule, "resets_opacities") == [600, 1200]
    assert [schedule.sh_degree(i) for i in (99, 100, 300)] == [0, 1, 3]


def test_the_rate_of_positions_decays_log_linearly():
    schedule = Schedule.scaled(3000)
    first, middle, last = (schedule.rates(i, extent=2.0).means for i in (0, 1500, 3000))
    np.testing.assert_allclose([first, middle, last], [3.2e-4, 3.2e-5, 3.2e-6], rtol=1e-12)


@given(lengths)
def test_learning_rates_of_networks_fall_after_growth_but_stay_above_zero(length):
    schedule = Schedule.scaled(length)
    shares = np.array([schedule.settling(i) for i in range(1, length + 1)])
    assert (shares[: schedule.densify_until] == 1).all()
    falling = shares[schedule.densify_until - 1 :]
    np.testing.assert_allclose(np.diff(falling), -falling[-1], rtol=1e-6)
    assert 0 < falling[-1] == pytest.approx(1 / len(falling))


@given(lengths, st.data())
def test_checkpoints_are_possible_between_periods_of_statistics(length, data):
    schedule = Schedule.scaled(length)
    iteration = data.draw(st.integers(1, length))
    later = [i for i in range(iteration + 1, length + 1) if schedule.densifies(i)]
    assert schedule.rests(iteration) or later or iteration < schedule.densify_until
    assert not (schedule.rests(iteration) and later and not schedule.densifies(iteration))
