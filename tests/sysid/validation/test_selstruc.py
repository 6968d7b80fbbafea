from functools import partial
from itertools import product

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.signal import lfilter
from scipy.stats import multivariate_normal

from sysid import (
    IOData,
    StateSpace,
    armax,
    arx,
    cross_validate,
    n4sid,
    oe,
    okid,
    predict,
    selstruc,
    simulate,
    structure_scan,
)
from sysid.models.estimate import mean_square
from sysid.validation import choose_orders
from tests.refusals import refused
from tests.sysid.systems import second_order

record = partial(second_order, samples=800, b=[0, 0, 1.0, 0.5], noise=0.5)  # ARX 2 2 2


def test_the_table_is_what_single_fits_give():
    data, fresh = record(0), record(1)
    table = selstruc(data, range(0, 4), (1, 2, 3), (0, 2), validation=fresh)
    assert len(table) == 24
    start = 4  # the longest lag of all candidates: nb = 3, nk = 2
    for orders, loss, validation in zip(table.orders, table.loss, table.validation, strict=True):
        na, nb, nk = orders
        fit = arx(IOData(data.u, data.y, 0.1, window=start), na, nb, nk)
        errors = lfilter(fit.polynomials.A, 1, data.y[:, 0]) - lfilter(fit.polynomials.B, 1, data.u[:, 0])
        assert loss == pytest.approx(np.mean(errors[start:] ** 2), rel=1e-9)
        errors = lfilter(fit.polynomials.A, 1, fresh.y[:, 0]) - lfilter(fit.polynomials.B, 1, fresh.u[:, 0])
        assert validation == pytest.approx(np.mean(errors[start:] ** 2), rel=1e-9)
    assert table.samples == 796
    assert (np.diff(table.validation) >= 0).all()


def test_the_right_structure_is_chosen():
    """BIC is consistent, AIC at least does not choose too little."""
    right = 0
    for seed in range(20):
        table = selstruc(record(seed), range(1, 6), range(1, 6), range(0, 4))
        right += table.chosen == {"na": 2, "nb": 2, "nk": 2}
        assert table.best(table.aic)["na"] >= 2
    assert right >= 18


def test_folds_are_fits_to_the_other_parts():
    data = record(3, samples=400)
    table = selstruc(data, (1, 2), 2, 2, folds=4)
    columns = np.array([[-data.y[t - 1, 0], -data.y[t - 2, 0], *data.u[t - 3 : t - 1, 0][::-1]] for t in range(3, 400)])
    total = 0.0
    for part in np.array_split(np.arange(397), 4):
        others = np.setdiff1d(np.arange(397), part)
        theta = np.linalg.lstsq(columns[others], data.y[3:, 0][others], rcond=None)[0]
        total += float(np.sum((data.y[3:, 0][part] - columns[part] @ theta) ** 2))
    assert table.validation[table.orders.index((2, 2, 2))] == pytest.approx(total / 397, rel=1e-9)
    assert table.best(table.validation)["na"] == 2


@pytest.mark.slow
def test_without_noise_the_smallest_exact_structure_wins():
    data = record(0, noise=0.0)[50:]
    assert selstruc(data, range(1, 5), range(1, 5), range(0, 4)).chosen == {"na": 2, "nb": 2, "nk": 2}
    # an output-error structure has as many
    table = structure_scan(oe, data, ("nb", "nf", "nk"), product((1, 2, 3), (1, 2, 3), (1, 2)))
    assert table.chosen == {"nb": 2, "nf": 2, "nk": 2}


def test_two_inputs_with_orders_of_their_own():
    rng = np.random.default_rng(5)
    u = rng.standard_normal((1500, 2))
    forced = lfilter([0, 1.0], 1, u[:, 0]) + lfilter([0, 0, 0, 0.8, 0.4], 1, u[:, 1])
    y = lfilter([1.0], [1, -0.8], forced + 0.3 * rng.standard_normal(1500))
    data = IOData(u, y, 0.1)
    table = selstruc(data, (1, 2), [(1, 1), (1, 2), (2, 2)], [(1, 1), (1, 3), (3, 3)])
    assert table.chosen == {"na": 1, "nb": (1, 2), "nk": (1, 3)}


def test_any_estimator():
    data, fresh = record(0), record(1)
    table = structure_scan(
        armax, data, ("na", "nb", "nc", "nk"), [(1, 1, 1, 2), (2, 2, 0, 2), (400, 300, 300, 1)], validation=fresh
    )
    assert table.chosen == {"na": 2, "nb": 2, "nc": 0, "nk": 2}
    assert "too many orders" in table.failed[0][1]
    fit = armax(data, 2, 2, 0, 2)
    assert table.validation[0] == pytest.approx(float(np.mean((fresh.y - predict(fit, fresh)) ** 2)), rel=1e-9)
    assert "validation" in str(table)
    by_order = structure_scan(lambda d, order: okid(d, order, p=8), data, ("order",), [(n,) for n in range(1, 6)])
    assert by_order.chosen["order"] in (2, 3)


def test_orders_go_to_the_parameters_that_their_names_say():
    data = record(0)
    table = structure_scan(oe, data, ("nb", "nf", "nk"), [(3, 1, 2), (1, 2, 1)])
    turned = structure_scan(oe, data, ("nk", "nf", "nb"), [(2, 1, 3), (1, 2, 1)])
    losses, others = (
        {frozenset(zip(t.names, o, strict=True)): loss for o, loss in zip(t.orders, t.loss, strict=True)}
        for t in (table, turned)
    )
    assert losses == others
    assert frozenset({"nb": 3, "nf": 1, "nk": 2}.items()) in losses
    assert choose_orders(arx, data, ("nb", "na"), [(1, 2), (3, 2), (4, 3)]) == {"nb": 3, "na": 2}
    for scan in (structure_scan, choose_orders):
        refused("named na, nb, nk, the parameters of the estimator nb, nf, nk", scan, oe, data, ("na", "nb", "nk"), [])
        refused("missing a required argument: 'nf'", scan, oe, data, ("nb",), [(1,)])
        refused("must differ, got nb, nb, nf", scan, oe, data, ("nb", "nb", "nf"), [(1, 1, 1)])


def six_outputs(seed):
    """Record of four states, two inputs and six outputs under white noise."""
    rng = np.random.default_rng(seed)
    A = block_diag([[0.8, 0.4], [-0.4, 0.8]], [[0.5, 0.6], [-0.6, 0.5]])
    B, C = rng.standard_normal((4, 2)), rng.standard_normal((6, 4))
    u = rng.standard_normal((300, 2))
    y = simulate(StateSpace(A, B, C, np.zeros((6, 2)), None, 0.1), u)
    return IOData(u, y + 2.0 * rng.standard_normal(y.shape), 0.1)


@pytest.mark.slow
@pytest.mark.parametrize("seed", (0, 1, 3))
def test_every_criterion_finds_the_order_of_six_outputs(seed):
    data = six_outputs(seed)
    table = structure_scan(n4sid, data, ("order",), [(n,) for n in range(1, 7)])
    for criterion in ("aic", "aicc", "bic", "fpe", "mdl"):
        assert table.best(criterion) == {"order": 4}, criterion
    for simulated in (False, True):
        chosen = choose_orders(n4sid, data, ("order",), [(n,) for n in range(1, 7)], simulated=simulated)
        assert chosen == {"order": 4}
    estimates = [n4sid(data, n) for n in range(1, 7)]
    for criterion in ("aic", "bic", "fpe"):
        assert int(np.argmin([getattr(e, criterion) for e in estimates])) == 3, criterion


def test_criteria_of_several_outputs_are_those_of_the_likelihood():
    data = six_outputs(0)
    estimate = n4sid(data, 2)
    table = structure_scan(n4sid, data, ("order",), [(2,)])
    p, n, ny = 2 * (2 + 2 * 6) + 2 * 6, len(data), 6
    assert len(estimate.parameters) == table.parameters[0] == p
    e = estimate.residuals
    likelihood = float(multivariate_normal(cov=e.T @ e / n).logpdf(e).sum())
    constant = ny * (1 + np.log(2 * np.pi))
    assert estimate.aic == pytest.approx((-2 * likelihood + 2 * p) / n - constant, rel=1e-10)
    assert estimate.bic == pytest.approx((-2 * likelihood + p * np.log(n)) / n - constant, rel=1e-10)
    # of n residuals of ny regressions with k regressors each, and in the table of those after the transient
    k, rows, v = p / ny, table.samples, table.loss[0]
    assert rows == n - 2
    assert estimate.fpe == pytest.approx(np.linalg.det(e.T @ e / n) ** (1 / ny) * (n + k) / (n - k), rel=1e-10)
    logarithm = ny * np.log(v)
    assert table.aic[0] == pytest.approx(logarithm + 2 * p / rows, rel=1e-12)
    assert table.bic[0] == pytest.approx(logarithm + p * np.log(rows) / rows, rel=1e-12)
    assert table.aicc[0] == pytest.approx(logarithm + 2 * p / (rows - k - (ny + 1) / 2), rel=1e-12)
    assert table.fpe[0] == pytest.approx(v * (rows + k) / (rows - k), rel=1e-12)
    assert table.mdl[0] == pytest.approx(v * (1 + k * np.log(rows) / rows), rel=1e-12)


def test_loss_of_many_outputs_of_small_unit():
    errors = np.random.default_rng(0).standard_normal((200, 40))
    assert mean_square(1e-6 * errors) / mean_square(errors) == pytest.approx(1e-12, rel=1e-10, abs=0.0)
    assert mean_square(np.ones((5, 2))) == pytest.approx(0.0, abs=1e-7)


def test_cross_validation_scores_what_was_left_out():
    data = record(2, samples=1000)
    scores = cross_validate(lambda parts: arx(parts, 2, 2, 2), data, folds=4)
    assert len(scores.fits) == 4
    one = arx([data[:250], data[500:750], data[750:]], 2, 2, 2)
    np.testing.assert_allclose(scores.estimates[1].parameters, one.parameters, rtol=1e-10)
    np.testing.assert_allclose(scores.one_step, np.mean([f.one_step for f in scores.fits], axis=0))
    small = cross_validate(lambda parts: arx(parts, 1, 1, 1), data, folds=4)
    assert scores.one_step[0] > small.one_step[0] + 5
    experiments = [record(seed, samples=300) for seed in range(3)]
    assert len(cross_validate(lambda parts: arx(parts, 2, 2, 2), experiments).fits) == 3


def test_refusals():
    data = record(0, samples=60)
    refused("too many orders", lambda: selstruc(data, (1, 40), (1, 30)))
    refused("at least one value", lambda: selstruc(data, (), 1))
    refused("not both", lambda: selstruc(data, 1, 1, validation=data, folds=3))
    refused("folds must be", lambda: selstruc(data, 1, 1, folds=1))
    refused("expected the orders nb, nf", lambda: structure_scan(oe, data, ("nb", "nf"), [(1, 2, 3)]))
    refused("could be fitted", lambda: structure_scan(oe, data, ("nb", "nf"), [(100, 100)]))
    table = selstruc(data, 1, 1)
    refused("no candidate has a finite value", table.best, table.validation)
    refused("folds must be", lambda: cross_validate(lambda parts: arx(parts, 1, 1), data, folds=1))
