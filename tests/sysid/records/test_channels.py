"""Channels are matched by name wherever a model meets a record, or a record another one."""

from dataclasses import replace

import numpy as np
import pytest

import sysid
from sysid import IOData, arx, compare, findstates, n4sid, oe, pem_ss, predict, resid, residuals, simulate
from sysid.records.channels import matching_channels
from sysid.recursive import roe
from sysid.validation.predictors import ModelPredictor
from tests.refusals import refused
from tests.sysid.systems import losing, multivariable, record_in_motion

NAMES = {"input_names": ("valve", "load"), "output_names": ("angle", "pressure")}
MODEL = replace(multivariable(), innovation_covariance=np.array([[1.0, 0.4], [0.4, 2.0]]), **NAMES)
DATA = replace(record_in_motion(MODEL, 600, noise=0.3), **NAMES)
TURNED = DATA.select(inputs=["load", "valve"], outputs=["pressure", "angle"])
OTHERS = replace(DATA, input_names=("temperature", "flow"))


def single_output(data):
    return data.select(outputs=["angle"])


@pytest.mark.parametrize("lost", [False, True])
@pytest.mark.parametrize("steps", [None, 1, 3])
def test_predictions_do_not_depend_on_the_sequence_of_channels(steps, lost):
    gap = slice(100, 140)
    data, turned = (losing(DATA, (gap, 0)), losing(TURNED, (gap, 1))) if lost else (DATA, TURNED)
    np.testing.assert_allclose(
        predict(MODEL, turned, steps=steps), predict(MODEL, data, steps=steps)[:, ::-1], rtol=1e-9, atol=1e-9
    )
    np.testing.assert_allclose(residuals(MODEL, turned), residuals(MODEL, data)[:, ::-1], rtol=1e-9, atol=1e-9)
    for simulation in (False, True):
        np.testing.assert_allclose(
            findstates(MODEL, turned, simulation=simulation), findstates(MODEL, data, simulation=simulation), rtol=1e-6
        )


def test_fits_and_residual_tests_follow_the_record():
    (fit,), (turned,) = compare(MODEL, DATA), compare(MODEL, TURNED)
    assert (fit.one_step > 50.0).all()
    np.testing.assert_allclose(turned.simulation, fit.simulation[::-1])
    np.testing.assert_allclose(turned.one_step, fit.one_step[::-1])
    assert turned.output_names == ("pressure", "angle")
    both = compare(MODEL, [DATA, TURNED])[0]
    np.testing.assert_allclose(both.by_experiment[1].one_step, both.by_experiment[0].one_step)
    test, other = resid(MODEL, DATA), resid(MODEL, TURNED)
    np.testing.assert_allclose(other.whiteness_p, test.whiteness_p[::-1], rtol=1e-6)
    np.testing.assert_allclose(other.independence_p, test.independence_p[::-1, ::-1], rtol=1e-6)


@pytest.mark.parametrize("meet", [predict, residuals, findstates, compare, resid, lambda m, d: pem_ss(d, m)])
def test_other_names_are_refused_with_both_lists(meet):
    refused(r"input\(s\) of the data are temperature, flow, those of the model valve, load", meet, MODEL, OTHERS)
    mixed = replace(DATA, output_names=("angle", "speed"))
    refused(r"output\(s\) of the data are angle, speed, those of the model angle, pressure", meet, MODEL, mixed)
    counts = r"1 input\(s\) \(load\) and 2 output\(s\) .*, the model 2 \(valve, load\) and 2 \(angle, pressure\)"
    refused(counts, meet, MODEL, DATA.select(inputs=["load"]))


def test_channels_without_names_are_matched_by_position():
    bare = IOData(DATA.u, DATA.y, DATA.dt)
    np.testing.assert_array_equal(predict(MODEL, bare), predict(MODEL, DATA))
    unnamed = replace(MODEL, **dict.fromkeys(NAMES))
    np.testing.assert_array_equal(predict(unnamed, DATA), predict(MODEL, DATA))
    turned = bare.select(inputs=["u2", "u1"])
    np.testing.assert_allclose(predict(unnamed, turned), predict(MODEL, DATA), rtol=1e-9)
    estimate = arx(bare.select(inputs=["u2"], outputs=["y1"]), 1, 1)
    refused("are u1, those of the model u2", predict, estimate, bare.select(inputs=["u1"], outputs=["y1"]))
    assert matching_channels("output", ("y1",), ("u1",), owner="a", other="b") == [0]
    refused(
        "are y2, y1, those of b angle, speed",
        lambda: matching_channels("output", ("y2", "y1"), ("angle", "speed"), owner="a", other="b"),
    )


def test_a_message_cuts_long_lists_of_names():
    many = tuple(f"thermocouple {k}" for k in range(60))
    with pytest.raises(ValueError, match=r"thermocouple 0, .* \.\.\., those of b") as caught:
        matching_channels("input", many, many[1:], owner="a", other="b")
    assert len(str(caught.value)) < 600


def test_experiments_are_joined_by_name():
    first, second = (single_output(d) for d in (DATA[:300], TURNED[300:]))
    expected = arx([first, single_output(DATA)[300:]], 2, 2)
    np.testing.assert_array_equal(arx([first, second], 2, 2).parameters, expected.parameters)
    refused("those of experiment 1 temperature, flow", arx, [first, single_output(OTHERS)], 2, 2)


def test_a_start_is_matched_by_name():
    start = n4sid(DATA, 4)
    expected = pem_ss(DATA, start, search=False).model.frequency_response([1.0, 5.0])
    turned = pem_ss(TURNED, start, search=False)
    assert turned.model.input_names == ("load", "valve")
    np.testing.assert_allclose(
        turned.model.frequency_response([1.0, 5.0]), expected[:, ::-1, ::-1], rtol=1e-3, atol=1e-3
    )
    estimate = oe(single_output(DATA), 1, 1)
    roe(single_output(DATA), 1, 1, start=estimate)
    refused(r"of the inputs valve, load in this sequence", roe, single_output(TURNED), 1, 1, start=estimate)
    refused("those of the model valve, load", roe, single_output(OTHERS), 1, 1, start=estimate)


def test_validation_data_are_matched_by_name():
    data, turned, others = map(single_output, (DATA, TURNED, OTHERS))
    # arguments by input differ: the sequence of the inputs is that of the data of the fit
    orders = (2, [(1, 3)], [(1, 2)])
    tables = [sysid.selstruc(data[:300], *orders, validation=d[300:]) for d in (data, turned)]
    assert tables[1].validation == pytest.approx(tables[0].validation, rel=1e-12)
    refused("of the validation data temperature, flow", sysid.selstruc, data[:300], *orders, validation=others)
    names = ("na", "nb", "nk")
    tables = [
        sysid.structure_scan(arx, data[:300], names, [(2, (1, 3), 1)], validation=d[300:]) for d in (data, turned)
    ]
    assert tables[1].validation == pytest.approx(tables[0].validation, rel=1e-9)


@pytest.mark.parametrize("window", [0, 50])
def test_an_operating_point_follows_its_channels(window):
    u, y = np.array([3.0, -5.0]), np.array([7.0, 20.0])
    predictor = ModelPredictor(MODEL, u, y)
    record = replace(DATA.subtract(u=-u, y=-y), window=window)
    turned = record.select(inputs=["load", "valve"], outputs=["pressure", "angle"])
    for steps in (0, 1):
        expected = predictor.predicted(record, steps)[:, ::-1]
        np.testing.assert_allclose(predictor.predicted(turned, steps), expected, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(
        ModelPredictor(MODEL).predicted(replace(turned, window=50), 0),
        ModelPredictor(MODEL).predicted(replace(record, window=50), 0)[:, ::-1],
        rtol=1e-6,
    )


def test_a_figure_of_outputs_matches_fits_by_name():
    (fit,) = compare(MODEL, TURNED)
    pytest.importorskip("matplotlib")
    output_comparison = sysid.plots.output_comparison
    figure = output_comparison(DATA, fit, output="pressure")
    drawn = [line.get_ydata() for line in figure.axes[0].get_lines()]
    np.testing.assert_allclose(drawn[1], simulate(MODEL, DATA.u, x0=findstates(MODEL, DATA, simulation=True))[:, 1])
    refused("channels are matched by name", output_comparison, replace(DATA, output_names=("a", "b")), fit)
