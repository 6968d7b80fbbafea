"""C, FMU and MATLAB exports compute what `simulate` computes and carry names, units, operating point and covariance."""

import ctypes
import os
import shutil
import subprocess
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from scipy.io import loadmat

import sysid
from sysid import IOData, StateSpace, simulate, to_fmu, to_matlab
from sysid.exchange import to_c
from tests.refusals import refused
from tests.sysid.continuous.record import record as continuous_record

DT = 0.02
OCTAVE = shutil.which("octave-cli") or shutil.which("octave")
STRICT = ["cc", "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror", "-fPIC", "-shared", "-O2"]
needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler: apt-get install gcc")
needs_octave = pytest.mark.skipif(OCTAVE is None, reason="Octave is not installed: apt-get install octave")


def plant(direct=0.0):
    """Two inputs, two outputs, three states."""
    rng = np.random.default_rng(3)
    A = np.diag([0.9, 0.5, -0.3]) + 0.1 * np.triu(rng.standard_normal((3, 3)), 1)
    B, C = rng.standard_normal((3, 2)), rng.standard_normal((2, 3))
    D = direct * rng.standard_normal((2, 2))
    names = {"input_names": ("oil */ µ", "u\\"), "output_names": ("y <1>", "y & 2")}
    return StateSpace(A, B, C, D, None, DT, 0.01 * np.eye(2), **names, input_units=("Pa", ""), output_units=("°", "m"))


def signal(samples=60, inputs=2):
    return np.random.default_rng(5).standard_normal((samples, inputs))


def record(model, samples=400):
    rng = np.random.default_rng(8)
    u = rng.standard_normal((samples, model.nu))
    labels = {key: getattr(model, key) for key in ("input_names", "output_names", "input_units", "output_units")}
    return IOData(u, simulate(model, u, rng=rng), model.dt, **labels)


def about_a_point(estimate):
    """With an operating point, and its levels."""
    level = np.arange(1.0, estimate.model.nu + 1.0), -np.arange(1.0, estimate.model.ny + 1.0)
    offsets = {"input_offset": tuple(level[0].tolist()), "output_offset": tuple(level[1].tolist())}
    return replace(estimate, data=replace(estimate.data, **offsets)), level


# --- C ---


@needs_compiler
@pytest.mark.parametrize(
    "model", [plant(1.0), StateSpace(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)), [[1.5, -2.0]], None, DT)]
)
def test_c_source_simulates(model, tmp_path):
    source, header = to_c(model, tmp_path / "servo.c")
    assert header.name == "servo.h"
    environment = {"PATH": os.defpath, **os.environ}
    subprocess.run([*STRICT, source, "-o", tmp_path / "servo.so"], env=environment, check=True)
    library = ctypes.CDLL(str(tmp_path / "servo.so"))
    memory, y = ctypes.create_string_buffer(1000), np.zeros(model.ny)
    library.servo_start(memory)
    u, got = signal(), []
    for row in u:
        library.servo_output(memory, row.ctypes, y.ctypes)
        got.append(y.copy())
        library.servo_step(memory, row.ctypes)
    np.testing.assert_allclose(got, simulate(model, u), rtol=1e-11, atol=1e-12)


# --- FMU ---


@needs_compiler
@pytest.mark.slow
def test_fmu_is_valid_and_simulates_about_its_operating_point(tmp_path):
    from fmpy import read_model_description, simulate_fmu
    from fmpy.validation import validate_fmu

    estimate, (u0, y0) = about_a_point(sysid.n4sid(record(plant()), 3))
    path = to_fmu(estimate, tmp_path / "servo.fmu")
    assert validate_fmu(str(path)) == []
    model = estimate.model
    description = read_model_description(str(path))
    units = {variable.name: variable.unit for variable in description.modelVariables}
    assert [units[name] for name in (*model.input_names, *model.output_names)] == ["Pa", None, "°", "m"]
    u = signal(200)
    time = DT * np.arange(len(u))
    table = np.zeros(len(u), dtype=[("time", float), *((name, float) for name in model.input_names)])
    table["time"] = time
    for name, column in zip(model.input_names, (u + u0).T, strict=True):
        table[name] = column
    x0 = np.array([0.3, -1.0, 2.0])
    result = simulate_fmu(
        str(path),
        stop_time=time[-1],
        output_interval=DT,
        input=table,
        start_values={f"state[{k + 1}]": value for k, value in enumerate(x0)},
    )
    got = np.column_stack([result[name] for name in model.output_names])
    model = replace(model, D=np.zeros((2, 2)))
    direct = estimate.model.D
    # fmpy reads outputs before it sets the next inputs: a direct term acts on those of the last step
    late = u[np.maximum(np.arange(len(u)) - 1, 0)] @ direct.T
    np.testing.assert_allclose(got, simulate(model, u, x0=x0) + late + y0, rtol=1e-10, atol=1e-11)


@needs_compiler
@pytest.mark.slow
def test_fmu_step_by_step(tmp_path):
    """A direct term acts at once, long steps hold the input, odd steps and outputs that are set are errors."""
    from fmpy import extract, read_model_description
    from fmpy.fmi1 import FMICallException
    from fmpy.fmi2 import FMU2Slave

    model, u = plant(1.0), signal()
    path = to_fmu(model, tmp_path / "servo.fmu")
    content = path.read_bytes()
    assert content == to_fmu(model, path).read_bytes()
    description, folder = read_model_description(str(path)), extract(str(path), tmp_path / "unzipped")
    slave = FMU2Slave(guid=description.guid, unzipDirectory=folder, modelIdentifier="servo", instanceName="servo")
    slave.instantiate()
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    for hold in (1, 3):
        slave.reset()
        got = []
        for k, row in enumerate(u):
            slave.setReal([0, 1], row)
            got.append(slave.getReal([2, 3]))
            slave.doStep(k * hold * DT, hold * DT)
        expected = simulate(model, np.repeat(u, hold, axis=0))[::hold]
        np.testing.assert_allclose(got, expected, rtol=1e-11, atol=1e-12)
    for wrong in (
        lambda: slave.doStep(0.0, 0.5 * DT),
        lambda: slave.doStep(0.0, 0.0),
        lambda: slave.setReal([2], [1.0]),
    ):
        with pytest.raises(FMICallException):
            wrong()
    slave.terminate()
    slave.freeInstance()


def test_an_fmu_without_a_compiler_is_source(tmp_path):
    with pytest.warns(sysid.SysidWarning, match="no C compiler 'no-such-compiler'"):
        path = to_fmu(plant(), tmp_path / "servo.fmu", compiler="no-such-compiler")
    with zipfile.ZipFile(path) as archive:
        names = {"modelDescription.xml", "sources/servo.h", "sources/servo.c", "sources/servo_fmi2.c"}
        assert set(archive.namelist()) == names
    assert path.read_bytes() == to_fmu(plant(), tmp_path / "servo.fmu", compiler=None).read_bytes()


def test_names_that_cannot_be_exported_are_refused(tmp_path):
    for name in ("1servo.c", "ser-vo.c", "for.c", "sérvo.c", "s" * 64 + ".c"):
        refused("expected a letter, then at most 62", to_c, plant(), tmp_path / name)
    refused(r"ends with \.fmu", to_fmu, plant(), tmp_path / "servo.zip")
    twice = replace(plant(), output_names=("u\\", "y"))
    refused("is empty, not printable or not unique", to_fmu, twice, tmp_path / "servo.fmu")
    refused("does not fit on a line", to_matlab, replace(plant(), input_names=("a\n", "b")), tmp_path / "servo.m")
    refused("Polynomials have no sampling interval", to_c, sysid.Polynomials(), tmp_path / "servo.c")
    series = replace(plant(), B=np.zeros((3, 0)), D=np.zeros((2, 0)), input_names=None, input_units=None)
    refused("time series, without input", to_fmu, series, tmp_path / "servo.fmu")
    assert list(tmp_path.iterdir()) == []


# --- MATLAB ---

# Constructors with MATLAB's documented arguments, and parameters in sequences that are not ours.
STUBS = {
    "idpoly": """function s = idpoly(A, B, C, D, F, NoiseVariance, Ts, varargin)
s = struct('kind', 'idpoly', 'A', A, 'B', {B}, 'C', C, 'D', D, 'F', {F}, 'NoiseVariance', NoiseVariance, 'Ts', Ts);
s = given(s, varargin{:});
c = @(p) [p{:}]; if ~iscell(B), B = {B}; F = {F}; end
s.vector = [c(cellfun(@(f) f(2:end), F, 'UniformOutput', false)), D(2:end), C(2:end), c(B), A(2:end)]';""",
    "idtf": """function s = idtf(num, den, Ts, varargin)
s = given(struct('kind', 'idtf', 'num', {num}, 'den', {den}, 'Ts', Ts), varargin{:});
s.vector = [s.IODelay(:)', [den{:}], [num{:}]]';""",
    "idss": """function s = idss(A, B, C, D, K, x0, Ts, varargin)
s = struct('kind', 'idss', 'A', A, 'B', B, 'C', C, 'D', D, 'K', K, 'x0', x0, 'Ts', Ts);
s = given(s, varargin{:});
s.vector = [A(:); B(:); C(:); D(:); K(:); x0(:)];""",
    "given": "function s = given(s, varargin)\nfor k = 1:2:numel(varargin), s.(varargin{k}) = varargin{k + 1}; end",
    "getpvec": "function p = getpvec(s)\np = s.vector;",
    "setcov": "function s = setcov(s, P)\nassert(isequal(size(P), numel(s.vector) * [1, 1]))\ns.covariance = P;",
}


def constructed(model, folder):
    """What the MATLAB function returns with the constructors above."""
    to_matlab(model, folder / "servo.m")
    for name, text in STUBS.items():
        (folder / f"{name}.m").write_text(f"{text}\nend\n", encoding="utf-8")
    script = "sys = servo(); save('-v7', 'out.mat', 'sys');"
    done = subprocess.run([OCTAVE, "--no-gui", "-qf", "--eval", script], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return loadmat(folder / "out.mat", simplify_cells=True)["sys"]


@needs_octave
@pytest.mark.slow
def test_matlab_constructs_polynomials(tmp_path):
    model = sysid.models.innovations_form(
        sysid.Polynomials(B=[[0, 0.1, 0.05], [0, 0, 0.2]], F=[[1, -1.5, 0.7], [1, -0.5, 0]], D=[1, -0.3]), DT, 0.01
    )
    names = {"input_names": ("it's", "b"), "input_units": ("V", "%"), "output_units": ("rad",)}
    estimate, (u0, y0) = about_a_point(sysid.bj(record(replace(model, **names)), (2, 1), 0, 1, (2, 1), (1, 2)))
    sys = constructed(estimate, tmp_path)
    p = estimate.polynomials
    assert (sys["kind"], sys["Ts"], sys["TimeUnit"]) == ("idpoly", DT, "seconds")
    assert sys["NoiseVariance"] == estimate.noise_variance.item()
    for j in range(2):
        for letter, row in zip("BF", p.channel(j), strict=True):
            np.testing.assert_array_equal(sys[letter][j], row)
    np.testing.assert_array_equal(sys["D"], p.D)
    assert list(sys["InputName"]) == ["it's", "b"]
    assert list(sys["InputUnit"]) == ["V", "%"]
    assert (sys["OutputName"], sys["OutputUnit"]) == ("y1", "rad")
    np.testing.assert_array_equal(sys["UserData"]["InputOffset"], u0)
    assert sys["UserData"]["OutputOffset"] == y0.item()
    at = [int(np.flatnonzero(sys["vector"] == value).item()) for value in estimate.parameters]
    np.testing.assert_array_equal(sys["covariance"][np.ix_(at, at)], estimate.covariance)
    rest = np.delete(np.arange(len(sys["vector"])), at)
    assert len(rest) and not sys["covariance"][rest].any()


@needs_octave
@pytest.mark.slow
def test_matlab_constructs_transfer_functions_in_continuous_time(tmp_path):
    first = continuous_record([4.0], [2.0, 1.0], 0.23, 0.1, 4, noise=0.05, samples=200)
    second = continuous_record([1.0], [1.0, 1.0], 0.0, 0.1, 4, samples=200, seed=1)
    both = IOData(np.hstack((first.u, second.u)), first.y + second.y, 0.1)
    estimate = sysid.procest(both, ["P1D", "P1"])
    sys = constructed(estimate, tmp_path)
    (k1, t1, late, k2, t2) = estimate.parameters
    np.testing.assert_allclose(sys["num"].astype(float), [k1 / t1, k2 / t2], rtol=1e-12)
    np.testing.assert_allclose(np.vstack(sys["den"]), [[1.0, 1.0 / t1], [1.0, 1.0 / t2]], rtol=1e-12)
    np.testing.assert_allclose(sys["IODelay"], [late, 0.0])
    assert (sys["kind"], sys["Ts"], sys["Structure"]["IODelay"]["Free"]) == ("idtf", 0, 1)
    # delays, denominators, numerators: Kp = b / a of each path
    slopes = np.zeros((3, 8))
    slopes[0, 0] = 1.0
    for j, (k, t) in enumerate(((k1, t1), (k2, t2)), start=1):
        slopes[j, 1 + 2 * j], slopes[j, 5 + j] = -k * t, t
    at = [2, 0, 3]
    expected = estimate.covariance[np.ix_(at, at)]
    np.testing.assert_allclose(slopes @ sys["covariance"] @ slopes.T, expected, rtol=1e-5, atol=1e-12)


@needs_octave
@pytest.mark.slow
def test_matlab_constructs_state_space_with_the_covariance_of_its_entries(tmp_path):
    """The variance of the response from the covariance of all entries is that of the estimate."""
    data = record(plant())
    estimate = sysid.pem_ss(data, sysid.n4sid(data, 3))
    sys = constructed(estimate, tmp_path)
    m = estimate.model
    for name in "ABCDK":
        np.testing.assert_array_equal(sys[name], getattr(m, name))
    np.testing.assert_array_equal(sys["NoiseVariance"], m.innovation_covariance)
    assert list(sys["OutputName"]) == ["y <1>", "y & 2"]
    f = [0.5, 4.0]

    def response(vector):
        parts, end = [], 0
        for shape in ((3, 3), (3, 2), (2, 3), (2, 2)):
            parts.append(vector[end : end + np.prod(shape)].reshape(shape, order="F"))
            end += np.prod(shape)
        g = StateSpace(*parts, None, DT).frequency_response(f)
        return np.stack((g.real, g.imag), axis=-1)

    steps = 1e-6 * np.eye(len(sys["vector"]))
    slopes = np.array([(response(sys["vector"] + s) - response(sys["vector"] - s)) / 2e-6 for s in steps])
    variance = np.einsum("k...,kl,l...->...", slopes, sys["covariance"], slopes)
    expected = np.einsum("...ii->...i", estimate.frequency_response(f).covariance)
    np.testing.assert_allclose(variance, expected, rtol=1e-3)
