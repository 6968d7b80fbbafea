"""Predictor-based subspace identification, consistent under feedback."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sysid.models.estimate import Estimate
from sysid.polynomial.data_checks import check_excitation, check_means
from sysid.polynomial.least_squares import LeastSquares, solve
from sysid.records.arguments import truth_value, whole_number
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import warn_each
from sysid.records.singular_values import svd
from sysid.subspace.gaps import estimate_with_gaps
from sysid.subspace.observer_gain import deadbeat_gain, spectral_radius, stable_gain
from sysid.subspace.observer_regression import ObserverRegression
from sysid.subspace.predictor import Predictor, Scales, local_coordinates
from sysid.subspace.predictor_estimate import check_enough_samples, make_predictor_estimate

LONGER = (1.0, 1.5, 2.0, 3.0, 4.0)  # pasts of which AIC selects one, relative to the horizon
ROWS_PER_COEFFICIENT = 5  # least number of samples per coefficient of the longest
FLOOR = 1e-10  # of the innovations, relative to the output: weights stay finite without noise
RANK = 1e-9  # singular value, relative to the largest, below which a state does not exist


def pbsid(
    data: IOData | Sequence[IOData],
    order: int,
    *,
    p: int | None = None,
    block_rows: int | None = None,
    direct: bool = False,
) -> Estimate:
    """Identify a state-space model in closed or open loop from its one-step predictor [Chiuso2007; vanderVeen2013].

    The method PBSID-opt: observer Markov parameters C (A - K C)^i [B - K D, K] by least squares, as in `okid`; their
    Hankel matrix times the past gives the observability matrix times the states; of its singular values the largest are
    kept. C and D follow by regression of the output on state and input, A, B and K by that of the next state on state,
    input and output. Nothing projects out future inputs, which under feedback depend on past noise: `n4sid` does, and
    is biased there. `pem_ss(data, pbsid(data, order))` refines the estimate and gives it intervals.

    Args:
        data: One experiment, or several that share the model; any numbers of inputs and outputs. Missing outputs are
            filled by their conditional means under the model, in several rounds.
        order: Number of states.
        p: Past, in samples; p * ny >= order. By default AIC selects it.
        block_rows: Future, in samples, at most p; by default 2.5 times the order, at least 10.
        direct: Whether D is estimated. Under feedback that acts within a sample it has no meaning.

    Returns:
        The estimate. `parameters` are local coordinates; their covariance and all intervals are NaN (unknown).
        Diagnostics: `singular_values`, `p`, `block_rows`.

    Raises:
        SysidError: Constant input, an order that past or data do not allow.

    Warns:
        SysidWarning: Poor excitation, means that do not fit the dynamics, an order beyond the rank of the data.
    """
    experiments = as_experiments(data, missing=True)
    nu, ny = experiments[0].nu, experiments[0].ny
    order, direct = whole_number("order", order, 1), truth_value("direct", direct)
    # of outputs that are missing none counts: filled ones tell nothing
    samples = check_enough_samples(experiments, order, order * (nu + 2 * ny) + nu * ny * direct)
    if not all(e.complete for e in experiments):

        def fit_filled(filled: Sequence[IOData], _: bool) -> Estimate:
            return pbsid(filled, order, p=p, block_rows=block_rows, direct=direct)

        return estimate_with_gaps(fit_filled, experiments, True)
    scales = Scales.of(experiments)
    scaled = [replace(e, u=e.u / scales.u, y=e.y / scales.y) for e in experiments]
    fewest = -(-order // ny)
    default = max(fewest, 10, -(-5 * order // 2))
    longest = max(samples // (ROWS_PER_COEFFICIENT * (nu + ny)), fewest)
    pasts = {min(int(factor * default), longest) for factor in LONGER}
    if p is not None:
        pasts = {whole_number("p", p, fewest)}
    regression, rows, fit = _best_regression(scaled, sorted(pasts), direct, samples)
    p = regression.p
    f = min(default, p) if block_rows is None else whole_number("block_rows", block_rows, fewest, p)
    messages = check_excitation(experiments, [p + 1] * nu) + check_means(experiments, fewest)

    innovation = fit.residual_gram / rows
    hankel = _predictor_hankel(fit.solution[nu * direct :], innovation, f, p)
    futures = [_product(replace(regression, experiments=(e,)), hankel) for e in scaled]
    # the triangle has the singular values of all states together, at the size of a single block
    _, values, vectors = svd(np.linalg.qr(np.vstack(futures), mode="r"))
    n = max(min(order, int((values > RANK * values[0]).sum())), 1)
    if n < order:
        messages.append(f"the past explains {n} state(s) of the data: the model has that order instead of {order}")
    predictor = _regressed([future @ (vectors[:n].T / values[:n]) for future in futures], scaled, direct)
    predictor, stability_messages = _stabilised(predictor, innovation)
    messages += stability_messages
    warn_each(messages)
    basis = local_coordinates(predictor, direct)
    return make_predictor_estimate(
        "pbsid",
        experiments,
        {"order": order, "p": p, "block_rows": f},
        scales,
        predictor=predictor,
        basis=basis,
        covariance=np.full((basis.shape[1],) * 2, np.nan),
        diagnostics={"iterations": 0, "converged": True, "singular_values": values},
        messages=messages,
    )


def _best_regression(
    records: Sequence[IOData], pasts: Sequence[int], direct: bool, samples: int
) -> tuple[ObserverRegression, int, LeastSquares]:
    """The regression of the past with the smallest AIC, its number of equations and its solution."""
    fits = []
    for past in pasts:
        regression = ObserverRegression(records, past, direct, False)
        # a regression that the data do not allow is refused before it is solved
        rows = regression.rows()
        fits.append((regression, rows, regression.solve()))
    criteria = [_aic(fit, rows, regression.width / samples) for regression, rows, fit in fits]
    return fits[int(np.argmin(criteria))]


def _aic(fit: LeastSquares, rows: int, share: float) -> float:
    """Akaike's criterion per sample; the rows decrease with p, and the samples, of which p takes a share, do not."""
    covariance = fit.residual_gram / rows + FLOOR * np.eye(len(fit.residual_gram))
    return float(np.linalg.slogdet(covariance)[1]) + 2.0 * len(covariance) * share


def _predictor_hankel(coefficients: FloatArray, innovation: FloatArray, f: int, p: int) -> FloatArray:
    """Block Hankel matrix of the observer Markov parameters, outputs weighted by their innovations (f ny, p (nu + ny)).

    Block (i, j) is C (A - K C)^(i + j) [B - K D, K], zero from the past p on: there the regression has none.
    """
    ny = len(innovation)
    weight = np.linalg.inv(np.linalg.cholesky(innovation + FLOOR * np.eye(ny)))
    markov = weight @ coefficients.T.reshape(ny, p, -1).transpose(1, 0, 2)
    hankel = np.zeros((f, ny, p, markov.shape[2]))
    for i in range(f):
        hankel[i, :, : p - i] = markov[i:].transpose(1, 0, 2)
    return hankel.reshape(f * ny, -1)


def _product(regression: ObserverRegression, hankel: FloatArray) -> FloatArray:
    """Observability matrix times states, from the past of each sample (rows, f ny)."""
    past = slice(regression.width - hankel.shape[1], regression.width)
    return np.vstack([block[:, past] @ hankel.T for block in regression.blocks()])


def _regressed(states: Sequence[FloatArray], records: Sequence[IOData], direct: bool) -> Predictor:
    """Predictor from states at the last samples of each record."""
    inputs = [e.u[-len(x) :] for x, e in zip(states, records, strict=True)]
    outputs = [e.y[-len(x) :] for x, e in zip(states, records, strict=True)]
    x, u, y = np.vstack(states), np.vstack(inputs), np.vstack(outputs)
    n, nu = x.shape[1], u.shape[1]
    regressors = np.hstack((x, u)) if direct else x
    output = solve(regressors, y).solution.T
    # next states within a record only: the last sample of one is not followed by the first of another
    present = np.vstack([np.hstack(signals)[:-1] for signals in zip(states, inputs, outputs, strict=True)])
    following = np.vstack([state[1:] for state in states])
    step = solve(present, following).solution.T
    D = output[:, n:] if direct else np.zeros((y.shape[1], nu))
    return Predictor(step[:, :n], step[:, n:], output[:, :n], D)


def _stabilised(predictor: Predictor, innovation: FloatArray) -> tuple[Predictor, list[str]]:
    """The predictor, its gain replaced if it is unstable, and warnings of that and of an unstable model."""
    messages: list[str] = []
    if not predictor.is_stable():
        predictor = _with_stable_gain(predictor, innovation)
        messages.append("the regression gives an unstable predictor: another innovation gain replaces its own")
    K = predictor.M[:, predictor.D.shape[1] :]
    radius = spectral_radius(predictor.A + K @ predictor.C)
    if radius >= 1.0:
        messages.append(f"the model is unstable: its largest pole has modulus {radius:.6g}")
    return predictor, messages


def _with_stable_gain(predictor: Predictor, innovation: FloatArray) -> Predictor:
    """Replace the gain by that of a stable predictor: of the same disturbance spectrum, else deadbeat."""
    C, D, nu = predictor.C, predictor.D, predictor.D.shape[1]
    K = predictor.M[:, nu:]
    A, B = predictor.A + K @ C, predictor.M[:, :nu] + K @ D
    K = stable_gain(A, C, K, innovation)
    if spectral_radius(A - K @ C) >= 1.0:
        K = deadbeat_gain(A, C)
    return Predictor(A - K @ C, np.hstack((B - K @ D, K)), C, D)
