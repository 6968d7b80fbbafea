"""A method that stands in the table is offered wherever it can be."""

import inspect

import numpy as np
import pytest

import sysid
from scenarios.commands.identify import identify
from scenarios.datasets.baselines import identified
from scenarios.datasets.spec import Method
from scenarios.estimators import ours
from scenarios.estimators.known_estimators import KNOWN
from scenarios.files.errors import ScenarioError
from scenarios.identification.methods import BENCH_ENTRIES, ESTIMATORS, METHODS, Knowledge
from scenarios.problems.registry import problem
from scenarios.station.identify_tab import MENU

RETURNS = {"estimate", "predictor", "model"}


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_its_function_takes_its_orders_by_their_names(method):
    assert method.title and method.returns in RETURNS
    parameters = inspect.signature(method.function).parameters
    names = (*method.orders, *method.optional, *method.knows)
    assert set(names) <= set(list(parameters)[1:])
    assert set(method.knows.values()) <= set(Knowledge._fields)
    assert set(method.least) <= set(names)


@pytest.mark.parametrize("name", METHODS)
def test_it_is_offered_by_what_it_returns(name):
    """On the command line with its help and in the station's menu; as a baseline; on the test bench."""
    method, metavar = METHODS[name], inspect.signature(identify).parameters["method"].annotation.__metadata__[0].metavar
    is_estimate = method.returns == "estimate"
    assert (name in ESTIMATORS) == (name in metavar.split("|")) == is_estimate
    assert (name in MENU.values()) == (is_estimate and not method.words)
    assert (f"{name} {method.usage}" in (identify.__doc__ or "")) == is_estimate
    orders = tuple(max(1, method.least.get(order, 1)) for order in method.orders)
    if method.returns == "model" or method.words:
        with pytest.raises(ScenarioError, match=f"unknown method '{name}'"):
            Method(name, orders)
    else:
        assert Method(name, orders).orders == (*orders, *method.optional.values())
    known = KNOWN.get(f"our-{name.replace('_', '-')}")
    assert (known is None) == (method.bench is None)
    if known is not None:
        assert known.estimator.settings == method.bench.settings
        assert callable(getattr(ours, known.estimator.target.rpartition(":")[2]))


@pytest.mark.parametrize("name", [name for name in ESTIMATORS if METHODS[name].bench])
def test_the_bench_and_the_baselines_call_the_same_function(name):
    """With the options of the bench and its orders; a baseline takes an operating point beside it."""
    record, bench = problem("p3@400").draw(1), BENCH_ENTRIES[name]
    task = problem("p3@400").task(bench.structure)
    method, optional = METHODS[name], {}
    if name == "okid":
        optional = {"p": ours.observer_parameters(record, task.orders["order"])}
    direct = method.function(record, **task.orders, **optional, **bench.options)
    np.testing.assert_array_equal(getattr(ours, name)(record, task).model.A, direct.model.A)
    values = [task.orders[order] for order in (*method.orders, *method.optional) if order in task.orders]
    predictor = identified(Method(name, tuple(values)), [record])
    assert predictor.model.order == direct.model.order
    assert isinstance(direct, sysid.Estimate)


def test_a_method_of_no_name_is_none_of_ours():
    with pytest.raises(AttributeError, match="has no attribute 'narx'"):
        ours.narx  # noqa: B018
