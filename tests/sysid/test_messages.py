import ast
import inspect
import re
import textwrap
import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
import sysid.plots
from sysid import IOData, StateSpace, SysidWarning
from sysid.polynomial.orders import make_orders
from sysid.records.printing import uncertain
from tests.refusals import refused
from tests.sysid.systems import second_order

U, E = np.random.default_rng(0).standard_normal((2, 600))
DATA = IOData(U, lfilter([0, 0.1], [1, -0.9], U) + 0.01 * E, 0.02, input_units=("rad",), name="robot")


def test_a_record_is_one_line():
    assert str(DATA) == "robot: 600 samples every 0.02 s; input u1 [rad]; output y1"
    assert "the first 10 to initialise" in str(IOData(DATA.u, DATA.y, 0.02, window=10))


def test_an_estimate_lists_parameters_with_their_deviations():
    estimate = sysid.oe(DATA, 1, 1, 1)
    first, *rest = str(estimate).splitlines()
    assert first.startswith("OE (")
    assert first.endswith("from 600 samples every 0.02 s")
    rows = {line.split()[0]: line.split()[1:] for line in rest}
    deviations = np.sqrt(np.diag(estimate.covariance))
    for name, value, deviation in zip(estimate.parameter_names, estimate.parameters, deviations, strict=True):
        number, sign, uncertainty = rows[name]
        assert sign == "±"
        assert float(number) == pytest.approx(value, abs=0.06 * deviation)
        assert float(uncertainty) == pytest.approx(deviation, rel=0.05)
    (pole,) = estimate.poles()
    shown = rows[f"{pole.real:.5g}"]
    frequency = abs(np.log(pole)) / (2.0 * np.pi * 0.02)
    np.testing.assert_allclose([float(number) for number in shown], [frequency, 1.0, 0.02 / -np.log(pole.real)], 1e-4)
    large = sysid.arx(DATA, 11, 11, 1)
    assert "22 parameters" in str(large)
    assert "A(q) = 1 - 0." in str(large)
    assert str(replace(large, diagnostics={"warnings": ("poor",)})).endswith("\n  warning: poor")
    # Deviations that are not known are left out.
    assert "nan" not in str(sysid.n4sid(second_order(noise=0.0), 1))


def test_fits_and_tests_give_their_verdict():
    estimate = sysid.oe(DATA, 1, 1, 1)
    (fit,) = sysid.compare({"mine": estimate}, DATA)
    line, note = str(fit).splitlines()
    assert line == f"mine: {fit.simulation[0]:.2f} % in simulation, {fit.one_step[0]:.2f} % one step ahead"
    assert note == "  estimated from this record, or from its beginning: no validation"
    good, bad = sysid.resid(estimate, DATA), sysid.resid(sysid.oe(DATA, 1, 0, 1), DATA)
    assert str(good).splitlines()[2].startswith("  y1 and u1: independent (p = ")
    assert "not passed" in str(bad)
    assert "y1: not white" in str(bad)


def test_short_forms_are_short():
    estimate = sysid.oe(DATA, 1, 1)
    assert repr(DATA) == "<IOData robot: 600 samples every 0.02 s; input u1 [rad]; output y1>"
    assert repr(estimate) == "<Estimate: OE (nb 1, nf 1, nk 1) from 600 samples every 0.02 s>"
    hz, low, high = estimate.bandwidth().path()
    assert repr(estimate.bandwidth()) == f"Bandwidth(hz={hz:.5g}, ci95=({low:.5g}, {high:.5g}), reference=0)"
    response, forecast = sysid.spa(DATA), sysid.forecast(estimate, DATA, 3, np.zeros((3, 1)))
    validation = sysid.cross_validate(lambda parts: sysid.arx(parts, 1, 1), DATA)
    band = sysid.band(estimate, StateSpace.dc_gain)
    orders, truth = make_orders(1, nb=1, nf=1, nk=1), estimate.polynomials
    bound = sysid.validation.cramer_rao_bound(truth, orders, DATA.u, dt=0.02, variance=1e-4, frequencies=np.ones(1))
    cells = uncertain(forecast.y, forecast.deviation)
    records = {
        sysid.delayest(DATA): "arx           1",
        sysid.identifiability(estimate): f"{estimate.parameter_names[0]} ",
        band: f"({band.ci95[0][0, 0]:.5g}, {band.ci95[1][0, 0]:.5g})",
        validation: f"{validation.simulation[0]:.2f} ± {validation.simulation_deviation[0]:.2f} %",
        sysid.era(estimate.model.markov(20), 1): f"{estimate.poles()[0].real:.5g}",
        sysid.rarx(DATA, 1, 1): "600 samples of parameters",
        response: uncertain(response.magnitude[0, 0], response.magnitude_deviation()[0, 0])[0],
        sysid.cra(DATA): "\n  10 ",
        forecast: f"12.02     {cells[1]}",
        estimate.bandwidth(): f"({low:.5g}, {high:.5g})",
        bound: f"{bound.bandwidth_hz[0, 0]:.5g}",
        sysid.resid(estimate, DATA): "y1: white",
    }
    for record, numbers in records.items():
        assert len(repr(record)) <= 160
        assert "\n" not in repr(record)
        assert numbers in str(record)
        assert max(map(len, str(record).splitlines())) <= 120


def test_okid_warns_of_outputs_that_its_model_does_not_explain():
    data = second_order(noise=0.1, d=[1.0])
    with pytest.warns(SysidWarning, match=r"worse than that of their mean: y1 -\d+ %"):
        sysid.okid(IOData(data.u + 10.0, data.y + 40.0, 0.1), 2, p=10)


@pytest.mark.parametrize(
    ("rule", "hint"),
    [(sysid.recursive.Forgetting(0.7), "larger forgetting"), (sysid.recursive.Gradient(1e3, False), "smaller gain")],
)
def test_a_diverging_recursion_is_refused_with_the_sample(rule, hint):
    rng = np.random.default_rng(0)
    u = np.where(np.arange(2000) < 500, rng.standard_normal(2000), 0.0)
    data = IOData(u, lfilter([0.0, 1.0, 0.5], [1.0, -1.5, 0.7], u) + 1e-3 * rng.standard_normal(2000), 0.1)
    refused(rf"at sample \d+ .*{hint}", lambda: sysid.rarx(data, 2, 2, adaptation=rule))


def test_a_wrong_period_is_reported():
    u = np.tile(U[:100], 6)
    data = IOData(u, lfilter([0.0, 1.0], [1.0, -0.8], u) + 0.01 * E, 0.1, window=100)
    with warnings.catch_warnings():
        warnings.simplefilter("error", SysidWarning)
        sysid.bla(data, 100)
    with pytest.warns(SysidWarning, match=r"input u1 of experiment 0 is not periodic with 90 samples: .* \d+\.?\d* %"):
        sysid.bla(data, 90)


def test_a_bandwidth_that_the_data_do_not_determine_ends_at_nyquist():
    estimate = sysid.arx(replace(DATA, dt=0.1)[:300], 1, 1)
    (low,), (high,) = estimate.bandwidth().ci95
    assert 0.0 < low < high < 5.0
    assert replace(estimate, covariance=4e3 * estimate.covariance).bandwidth().ci95[1] == 5.0
    with pytest.warns(SysidWarning, match="bandwidth is not determined"):
        unknown = replace(estimate, covariance=1e6 * estimate.covariance).bandwidth()
    assert unknown.ci95 == (0.0, 5.0)


def functions():
    """Public functions of the package and of its plots, and the public methods of its public classes."""
    rooms = (sysid.records, sysid.models, sysid.polynomial, sysid.validation, sysid.subspace, sysid.recursive)
    for package in (sysid, *rooms, sysid.frequency, sysid.plots):
        for name in package.__all__:
            thing = getattr(package, name)
            if inspect.isfunction(thing):
                yield f"{package.__name__}.{name}", thing
            elif inspect.isclass(thing):
                for own, member in vars(thing).items():
                    member = member.__func__ if isinstance(member, staticmethod | classmethod) else member
                    if not own.startswith("_") and inspect.isfunction(member):
                        yield f"{package.__name__}.{name}.{own}", member


PUBLIC = dict(functions())


@pytest.mark.slow
@pytest.mark.parametrize("name", PUBLIC)
def test_docstrings_have_their_sections(name):
    function = PUBLIC[name]
    text = inspect.getdoc(function) or ""
    parameters = [p for p in inspect.signature(function).parameters if p != "self"]
    (node,) = ast.parse(textwrap.dedent(inspect.getsource(function))).body
    raises = any(isinstance(part, ast.Raise) and part.exc is not None for part in ast.walk(node))
    method = name.split(".")[-2][0].isupper()
    if parameters and not method:
        assert "\nArgs:\n" in text, f"{name} has no section on its arguments"
    if "\nArgs:\n" in text:
        section = re.split(r"\n(?=\S)", text.split("\nArgs:\n")[1])[0]
        described = re.findall(r"^    (\w+):", section, re.M)
        assert described == parameters, f"{name} describes {described}, it takes {parameters}"
    if not method and inspect.signature(function).return_annotation is not None:
        assert "\nReturns:\n" in text, f"{name} does not say what it returns"
    if raises:
        assert "\nRaises:\n" in text, f"{name} raises and does not say what"
