import inspect
import warnings

import numpy as np
import pytest

import sysid
from sysid import FrequencyResponse, IOData, SysidWarning
from tests.refusals import refused
from tests.sysid.systems import second_order

HZ = np.linspace(0.1, 5.0, 20)
G = 1.0 / (1.0 + 1j * HZ)
RECORD = second_order(0, 200, noise=0.1)
RAGGED = [[1, 2], [3]]
PILOT = sysid.arx(RECORD, 1, 1)


def of_data(response=G, **options):
    return FrequencyResponse.from_data(HZ, response, **options)


@pytest.mark.parametrize("many", [10**9, 2**70])
@pytest.mark.parametrize(
    ("name", "call"),
    [
        ("n", sysid.idinput),
        ("inputs", lambda k: sysid.idinput(20, inputs=k)),
        ("periods", lambda k: sysid.idinput(20, periods=k)),
        ("samples", lambda k: sysid.design_input(PILOT, k, amplitude=1.0)),
        ("order", lambda k: sysid.vector_fit(of_data(), k)),
        ("nk", lambda k: sysid.fit_response(of_data(dt=0.1), 1, 1, k)),
        ("poles", lambda k: sysid.tfest(RECORD, k)),
    ],
)
def test_numbers_without_bound(name, call, many):
    refused(f"{name} must be a whole number from", call, many)


@pytest.mark.parametrize(
    ("message", "call"),
    [
        ("expected a FrequencyResponse", lambda: sysid.vector_fit(None, 2)),
        ("Polynomials to start", lambda: sysid.polyest(RECORD, 1, 1, 1, 0, 0, start=5)),
        ("frequencies: expected a list", lambda: sysid.spafdr(RECORD, frequencies=[])),
        ("dt must", lambda: sysid.read_csv(__file__, dt="0.02")),
        ("inputs by name", lambda: sysid.read_csv(__file__, inputs=None)),
        ("expected the paths", lambda: sysid.read_experiments(None)),
        ("response.*ragged", lambda: of_data(RAGGED)),
        ("variance.*ragged", lambda: of_data(variance=RAGGED)),
        ("covariance.*ragged", lambda: of_data(covariance=RAGGED)),
        (r"coherence: expected shape \(20, 1, 1\)", lambda: of_data(coherence=[1.0], averages=9)),
        ("dt must", lambda: of_data(dt=RAGGED)),
        ("dt must", lambda: of_data(dt=[])),
        ("averages belong", lambda: of_data(averages=9)),
        ("expected texts", lambda: of_data(input_names=[None])),
        ("change the unit", lambda: of_data(G * 1e200)),
        ("change the unit", lambda: of_data(G * 1e-200)),
        ("level must", lambda: sysid.feedback(RECORD, level=RAGGED)),
        ("max_delay must", lambda: sysid.tfest(RECORD, 1, max_delay=RAGGED)),
        ("nb must", lambda: sysid.polyest(RECORD, 1, b"x", 0, 0, 0)),
        ("nk must", lambda: sysid.two_stage(RECORD, 1, 1, b"x", RECORD.u)),
        ("delay is of continuous time", lambda: sysid.fit_response(of_data(dt=0.1), 1, 1, delay="x")),
        ("rbs does not take clock", lambda: sysid.idinput(20, clock=0)),
        ("rbs does not take register", lambda: sysid.idinput(20, register=[])),
        ("intersample must", lambda: sysid.d2c(PILOT, intersample=[])),
        ("zero at all frequencies", lambda: sysid.tfest(of_data(0.0 * G), 1, 0)),
        ("zero at all frequencies", lambda: sysid.tfest(of_data(np.stack((G, 0.0 * G), 1)[:, None]), 1, 0)),
        ("zero at all frequencies", lambda: sysid.fit_response_ss(of_data(0.0 * G), 2)),
    ],
)
def test_wrong_values_have_a_clear_message(message, call):
    refused(message, call)


def test_a_response_of_zero_has_a_vector_fit():
    assert not sysid.vector_fit(of_data(0.0 * G), 2).frequency_response(HZ).any()


def test_frequencies_without_power_do_not_stop_merge_and_vector_fit():
    rng = np.random.default_rng(0)
    u = np.repeat(rng.choice([-1.0, 1.0], (200, 2)), 2, axis=0)
    y = np.convolve(u.sum(axis=1), [0.0, 0.5, 0.3])[:400] + 0.1 * rng.standard_normal(400)
    response = sysid.spa(IOData(u, y, 0.1))
    known = np.isfinite(response.covariance).all(axis=(1, 2, 3, 4))
    assert not known.all()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        merged = sysid.merge([response, response])
        fit = sysid.vector_fit(response, 2)
    np.testing.assert_allclose(merged.response[known], response.response[known], 1e-6)
    np.testing.assert_allclose(merged.covariance[known], 0.5 * response.covariance[known], 1e-6, 1e-15)
    assert np.isnan(merged.response[~known]).all()
    assert np.isfinite(fit.residues).all()


def test_an_exact_response_outweighs_others():
    merged = sysid.merge([of_data(variance=np.zeros(20)), of_data(2.0 * G, variance=np.ones(20))])
    np.testing.assert_allclose(merged.response[:, 0, 0], G, 1e-9)
    assert merged.covariance.max() < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 2])
def test_parameters_that_are_collinear_do_not_widen_the_response(seed):
    # a numerator b1 s + b0 and a delay are the same to first order where b1 is zero
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], 200), 2)
    record = IOData(u, np.convolve(u, [0.0, 0.5, 0.3])[:400] + 0.1 * rng.standard_normal(400), 0.1)
    with pytest.warns(SysidWarning, match="determines 4 of 5"):
        model = sysid.tfest(sysid.etfe(record, smoothing=10), 2, 1, delay=None)
    deviations = model.frequency_response(np.linspace(0.1, 4.0, 9)).magnitude_deviation()
    assert deviations.max() < 0.1


SERIES = IOData(None, RECORD.y, RECORD.dt)
CALLS = {
    "ar": (SERIES, 1),
    "arma": (SERIES, 1, 1),
    "armax": (RECORD, 1, 1, 1),
    "arx": (RECORD, 1, 1),
    "balred": (PILOT, 1),
    "bj": (RECORD, 1, 1, 1, 1),
    "d2c": (PILOT,),
    "findstates": (PILOT, RECORD),
    "idinput": (20,),
    "impulseest": (RECORD, 5),
    "n4sid": (RECORD, 1),
    "oe": (RECORD, 1, 1),
    "okid": (RECORD, 1),
    "pbsid": (RECORD, 1),
    "pem_ss": (RECORD, 1),
    "polyest": (RECORD, 1, 1, 1, 0, 0),
    "procest": (RECORD, "P1"),
    "tfest": (RECORD, 1),
    "vector_fit": (of_data(), 2),
}
"""Functions with options that are Boolean or a choice by name, and arguments before them."""


@pytest.mark.parametrize("name", CALLS)
def test_options_that_are_flags_or_choices_refuse_everything_else(name):
    call = getattr(sysid, name)
    required = {"p": 2} if name == "okid" else {}
    for option, parameter in inspect.signature(call).parameters.items():
        is_choice = "Literal" in str(parameter.annotation) or isinstance(parameter.default, bool | str)
        if is_choice:
            for wrong in (np.array([1, 1]), np.array(["a", "b"]), [1, 1], {"a": 1}, np.nan, 10**400, RAGGED):
                refused(f"{option} must ", call, *CALLS[name], **required, **{option: wrong})


@pytest.mark.parametrize(
    ("message", "call"),
    [
        ("time must be a text or None", lambda: sysid.read_csv(__file__, time=np.array([1, 1]))),
        ("time_unit must be a text or None", lambda: sysid.read_csv(__file__, time_unit=["s"])),
        ("outputs by name", lambda: sysid.read_csv(__file__, outputs=[["y"]])),
        ("outputs by name", lambda: sysid.from_dataframe(RECORD.to_dataframe(), outputs=5)),
        ("missing must", lambda: sysid.from_dataframe(RECORD.to_dataframe(), missing=np.array([1, 1]))),
        ("intersample must", lambda: IOData(RECORD.u, RECORD.y, 0.1, intersample=np.array(["zoh", "foh"]))),
        ("no input", lambda: RECORD.select(inputs=RAGGED)),
        ("path of a file", lambda: sysid.read_model(5)),
        ("path of a file", lambda: sysid.write_model(PILOT, None)),
        ("path of a file", lambda: sysid.to_matlab(PILOT, [1, 1])),
        ("path of a file", lambda: sysid.read_model("a\0b.json")),
        ("quantity must be a function", lambda: sysid.band(PILOT, [1, 1])),
        ("quantity must give real numbers", lambda: sysid.band(PILOT, lambda model: model)),
        ("lines: .*ragged", lambda: sysid.bla(RECORD, 100, lines=RAGGED)),
        ("B: .*ragged", lambda: sysid.Polynomials(B=RAGGED)),
        ("kept: .*list of indices", lambda: of_data().select(0)),
        ("f_hz: expected a list", lambda: PILOT.frequency_response(np.ones((3, 3)))),
        ("methods: expected some", lambda: sysid.auto(RECORD, methods=5)),
        ("methods: expected some", lambda: sysid.auto(RECORD, methods=RAGGED)),
        (
            "determine no orders up to 1000000000; expected more, or a smaller largest",
            lambda: sysid.auto(RECORD, largest=10**9),
        ),
        ("estimator must be a function", lambda: sysid.structure_scan(5, RECORD, ("na",), [(1,)])),
        ("has no named parameters", lambda: sysid.structure_scan(int, RECORD, ("na",), [(1,)])),
        ("names of orders as texts", lambda: sysid.structure_scan(sysid.arx, RECORD, [1, 2], [(1, 1)])),
        ("expected candidates", lambda: sysid.structure_scan(sysid.arx, RECORD, ("na", "nb"), 5)),
        ("order must be", lambda: sysid.selstruc(RECORD, 1, np.array([1.5, 2.5]))),
        ("input must be a whole number", lambda: sysid.zero_pole_gain(PILOT, input=[0])),
        ("input must be a whole number", lambda: PILOT.model.channel("u", 0)),
        ("n must be a whole number", lambda: PILOT.model.step_response(10**30)),
        ("up must be a whole number", lambda: sysid.resample(RECORD, 10**400)),
        ("whitening must be", lambda: sysid.delayest(RECORD, whitening=10**9)),
    ],
)
def test_values_of_other_types_have_a_clear_message(message, call):
    refused(message, call)


@pytest.mark.parametrize(
    ("message", "call"),
    [
        ("size must be", lambda: sysid.plots.bode(PILOT, size=5.0)),
        ("size must be", lambda: sysid.plots.record(RECORD, size=(0.0, 1.0))),
        ("relative_to_dc must be", lambda: sysid.plots.bode(PILOT, relative_to_dc=np.array([1, 1]))),
        ("phase_limits must be", lambda: sysid.plots.bode(PILOT, phase_limits=np.nan)),
        ("phase_limits: .*ragged", lambda: sysid.plots.bode(PILOT, phase_limits=RAGGED)),
        ("mark_hz must be", lambda: sysid.plots.bode(PILOT, mark_hz={"a": 1})),
        ("limits_hz must be", lambda: sysid.plots.bode(PILOT, limits_hz={"a": 1})),
        ("frequencies: .*ragged", lambda: sysid.plots.spectra(PILOT, frequencies=RAGGED)),
        ("length must be", lambda: sysid.plots.step(PILOT, length=[1, 1])),
        ("start must be", lambda: sysid.plots.record(RECORD, start=np.nan)),
        ("length must be", lambda: sysid.plots.record(RECORD, length=np.array([1, 1]))),
        ("regions must be", lambda: sysid.plots.pzmap(PILOT, regions=np.array([1, 1]))),
        ("limit must be", lambda: sysid.plots.singular_values(PILOT, limit=[1, 1])),
    ],
)
def test_figures_refuse_sizes_and_limits_of_other_types(message, call):
    pytest.importorskip("matplotlib")
    refused(message, call)
