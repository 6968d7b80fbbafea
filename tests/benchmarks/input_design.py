"""Designed inputs beside the PRBS of the thesis: predicted and simulated standard deviations of the bandwidth.

For each studied joint the model is OE 3 3 fitted to its small-signal truth, with the noise of its resolver, white or
first-order autoregressive. Both inputs have the amplitude of test 5 (1 V), its velocity limit and its update rate, and
are equally long. Records of the model start from rest; means are removed before the estimate, OE 3 3 or BJ 3 0 1 3. The
last column is the error of OE 3 3 itself: from a record of the whole truth without noise.
"""

import warnings
from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

import sysid
from hmtb_twin import STUDIED_JOINTS, linearize, load_arm
from hmtb_twin.parameters.values import HAND_CONTROLLER, SAMPLE_TIME
from hmtb_twin.parameters.variants import MOTIONS
from scenarios.experiments.excitation import prbs
from tests.benchmarks.tables import heading, options, row, timed

ORDER, COLOUR, SETTLING = 3, 0.9, 200
"""Order of the models, pole of the coloured noise, and samples in which it becomes stationary."""


def fitted(path, u, delay):
    """Output-error model of order 3 of a path without noise."""
    return sysid.oe(sysid.IOData(u, sysid.simulate(path, u), SAMPLE_TIME).detrend(), ORDER, ORDER, delay)


def scatter(system, variance, u, delay, draws):
    """Standard deviation of the bandwidths, Hz, of estimates from records of one input."""
    quiet = sysid.simulate(sysid.models.innovations_form(replace(system, D=[1.0]), SAMPLE_TIME), u)[:, 0]
    bandwidths = []
    for seed in range(draws):
        e = np.sqrt(variance) * np.random.default_rng(seed).standard_normal(len(u) + SETTLING)
        data = sysid.IOData(u, quiet + lfilter([1.0], system.D, e)[SETTLING:], SAMPLE_TIME).detrend()
        # OE where the disturbance is white
        estimate = sysid.polyest(data, 0, ORDER, 0, len(system.D) - 1, ORDER, delay)
        bandwidths.append(estimate.model.bandwidth()[0, 0])
    return float(np.std(bandwidths, ddof=1))


def main():
    parser = options(__doc__)
    parser.add_argument("--draws", type=int, default=500)
    parser.add_argument("--samples", type=int, default=3000)
    asked = parser.parse_args()
    warnings.simplefilter("ignore", sysid.SysidWarning)
    amplitude = HAND_CONTROLLER.gain
    binary = amplitude * np.resize(prbs(clock=2, seed=0).points, asked.samples)
    truths = linearize(load_arm(), amplitudes=())
    deviations = ("predicted / mHz", "simulated / mHz", "ratio", "bound / mHz")
    heading("joint", "noise", "input", *deviations, "variances, PRBS = 1", "design / s", "error of order 3 / mHz")
    for name in STUDIED_JOINTS:
        joint = truths.joint(name)
        whole = replace(joint.model, K=None, innovation_covariance=None)
        low = fitted(
            whole, amplitude * np.repeat(np.random.default_rng(0).choice([-1.0, 1.0], 1500), 2), joint.delay_samples
        )
        for colour in (0.0, COLOUR):
            variance = float(joint.model.innovation_covariance[0, 0]) * (1.0 - colour**2)
            system = replace(low.polynomials, D=[1.0, -colour] if colour else [1.0])
            limits = {"amplitude": amplitude, "rate": MOTIONS[name].velocity_limit, "comparison": binary}
            design, seconds = timed(
                sysid.design_input, system, asked.samples, dt=SAMPLE_TIME, variance=variance, **limits
            )
            base = None
            for label, u, predicted in (("PRBS", binary, design.comparison), ("designed", design.u, design.deviation)):
                simulated = scatter(system, variance, u, joint.delay_samples, asked.draws)
                base = base or (predicted, simulated)
                shares = [f"{(one / of) ** 2:.3f}" for one, of in zip((predicted, simulated), base, strict=True)]
                error = fitted(whole, u, joint.delay_samples).model.bandwidth()[0, 0] - joint.bandwidth_hz
                row(
                    name.replace("_", " "),
                    "coloured" if colour else "white",
                    label,
                    *(f"{1e3 * one:.3f}" for one in (predicted, simulated)),
                    f"{simulated / predicted:.3f}",
                    f"{1e3 * design.bound:.3f}",
                    " and ".join(shares),
                    "" if label == "PRBS" else f"{seconds:.2f}",
                    f"{1e3 * error:.1f}",
                )


if __name__ == "__main__":
    main()
