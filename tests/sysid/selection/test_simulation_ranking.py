"""Choice by simulation beside the criterion of one-step errors, on systems whose best model is known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, auto, compare, oe
from sysid.polynomial.orders import Orders
from sysid.selection.simulation_ranking import better_in_simulation
from sysid.selection.structure_search import ORDERS, StructureSearch
from tests.benchmarks.nonlinear_joints import joint

B, F = [0.0, 0.02, 0.015], [1.0, -1.8, 0.835]


def record(rng):
    """White noise of a tenth of the output, of which least squares makes a biased model."""
    u = np.repeat(rng.choice([-1.0, 1.0], 150), 8)
    y = lfilter(B, F, u)
    return IOData(u, y + 0.1 * y.std() * rng.standard_normal(len(y)), 0.02).detrend()


def searched(data, methods):
    search = StructureSearch((data,), (), 10, methods)
    search.climb_structures((1,), (1,))
    return search


def test_a_biased_model_makes_way_for_one_that_simulates_better():
    data = record(np.random.default_rng(0))
    search = StructureSearch((data,), (), 10, ("arx", "oe"))
    biased = search.try_orders(Orders(2, (2,), 0, 0, (0,), (1,)))
    ranking = better_in_simulation(search, biased, (1,), is_nonlinear=False)
    assert ranking.candidate.method == "oe"
    assert ranking.candidate.orders["nf"] == 2
    assert ranking.ratio < 0.8
    # the true structure leaves the noise alone in simulation
    true = oe(data, 2, 2, 1)
    assert true.dc_gain()[0, 0] == pytest.approx(sum(B) / sum(F), rel=0.05)


@pytest.mark.parametrize("seed", range(3))
def test_the_best_of_a_linear_system_stays(seed):
    search = searched(record(np.random.default_rng(seed)), tuple(ORDERS))
    best = search.ranked()[0]
    assert better_in_simulation(search, best, (1,), is_nonlinear=False) is None


def test_candidates_are_refined_on_other_records_to_the_minimum_of_the_estimator():
    data = record(np.random.default_rng(3))
    search = StructureSearch((data,), (), 10, ("oe",))
    candidate = search.try_orders(Orders(0, (2,), 0, 0, (2,), (1,)))
    path = search.input_path_on((data[:600],), candidate)
    assert path.dc_gain() == pytest.approx(oe(data[:600], 2, 2, 1).dc_gain(), rel=1e-3)
    assert search.input_path_of(candidate).dc_gain() == pytest.approx(oe(data, 2, 2, 1).dc_gain(), rel=1e-3)


def test_too_short_records_are_not_split():
    data = record(np.random.default_rng(1))[:150]
    search = StructureSearch((data,), (), 10, ("arx", "oe"))
    biased = search.try_orders(Orders(2, (2,), 0, 0, (0,), (1,)))
    assert better_in_simulation(search, biased, (1,), is_nonlinear=False) is None


@pytest.mark.parametrize("seed", [2, 18, 35])
def test_beside_friction_the_smallest_model_that_simulates_as_well_is_chosen(seed):
    """Criteria of one-step errors choose up to eight poles and zeros for these joints, which have two poles."""
    _, data = joint(np.random.default_rng([41, seed]), "friction")
    data = data.detrend()
    end = 3 * len(data) // 4
    to_fit, held_out = data[:end], replace(data[end // 2 :], window=end - end // 2)
    choice = auto(to_fit)
    assert choice.estimate.model.input_path().order <= 5
    of_orders = [oe(to_fit, n, n, 1) for n in range(1, 9)]
    (chosen, *others) = compare([choice.estimate, *of_orders], held_out)
    assert chosen.simulation[0] >= max(fit.simulation[0] for fit in others) - 0.5
