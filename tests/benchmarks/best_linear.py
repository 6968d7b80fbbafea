"""How the best linear approximation departs from the small-signal truth: link by link and amplitude by amplitude.

First the agreement of the arm without friction, seed by seed: p-values of the lines and of the whole, and what the
intervals of the bandwidth hold. Then the tables that `docs/truth.md` quotes.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.stats import kstest

from hmtb_twin import IDEAL, NOMINAL_PLANT, STUDIED_JOINTS, Chain, Plant, linearize, load_arm
from scenarios.experiments.multisines import MultisineExperiment, Multisines
from scenarios.truth.best_linear import best_linear
from sysid.models.bandwidth import response_bandwidth
from tests.benchmarks.tables import heading, options, row

QUIET = replace(IDEAL, resolver=True)  # measurement noise alone

RUBBING = replace(QUIET, friction=True)

LINKS: Mapping[str, tuple[Chain, Plant]] = {
    "resolver alone": (QUIET, NOMINAL_PLANT),
    "Coulomb friction": (RUBBING, replace(NOMINAL_PLANT, friction="coulomb")),
    "LuGre friction": (RUBBING, NOMINAL_PLANT),
    "LuGre friction, 8 times": (RUBBING, replace(NOMINAL_PLANT, friction_level=8.0)),
    "orifice valve": (QUIET, replace(NOMINAL_PLANT, actuator="orifice")),
    "velocity limit": (replace(QUIET, velocity_limit=True), NOMINAL_PLANT),
    "12-bit converters": (replace(QUIET, dac=True, adc=True), NOMINAL_PLANT),
    "wires": (replace(QUIET, noise=True, bias=True), NOMINAL_PLANT),
    "all links": (Chain(), NOMINAL_PLANT),
}

FREQUENCIES = (0.3, 1.0, 3.0)


def near(response_agreement, frequency):
    """Gain and phase departure, averaged over the lines within a sixth of an octave."""
    f = response_agreement.frequencies
    chosen = np.abs(np.log2(f / frequency)) < 1.0 / 6.0
    ratio = response_agreement.ratio[chosen, 0, 0].mean()
    return f"{20 * np.log10(abs(ratio)):+.2f} / {np.degrees(np.angle(ratio)):+.1f}"


def departure(name, path, truth, agreement, distortion):
    """Print one row of the table; the p-value and the bandwidth are those from the command."""
    band = truth.bandwidth
    row(
        name,
        f"{1e3 * truth.experiment.multisines.rms:g}",
        path,
        *(near(agreement, f) for f in FREQUENCIES),
        f"{distortion:.2g}",
        f"{truth.servo_agreement().p_all[0, 0]:.2g}",
        f"{band.hz[0, 0]:.3f} ({band.ci95[0][0, 0]:.3f} to {band.ci95[1][0, 0]:.3f})",
        f"{100 * truth.slewing:.0f}",
    )


def departures(joint, multisines):
    """Print the table of one joint: from the command, and from the stick where a link lies between the two."""
    heads = (f"{f:g} Hz: dB / deg" for f in FREQUENCIES)
    print(f"\n`{joint}`\n")
    last = ("distortion, %", "p, from command", "bandwidth, Hz", "slewing, %")
    heading("link", "rms, mrad", "from", *heads, *last)
    for name, (chain, plant) in LINKS.items():
        for rms in (0.003, 0.01, 0.03):
            setting = MultisineExperiment("departure", (joint,), chain=chain, plant=plant)
            truth = best_linear(setting, replace(multisines, rms=rms))
            before = chain.velocity_limit or chain.adc or chain.noise
            if chain.friction or not before:
                departure(name, "command", truth, truth.servo_agreement(), float(truth.distortion_percent[0]))
            if before:
                departure(name, "stick", truth, truth.agreement(truth.chain), float(truth.chain.distortion_percent[0]))


def agreement(joint, seeds, multisines, truth):
    """p-values of all lines, p-values of each seed, and how many of the seeds' intervals hold the true bandwidth.

    It is read from the true response at the same lines as from the measured one.
    """
    lines, whole, covered = [], [], 0
    model = truth.joint(joint).model
    for seed in range(seeds):
        setting = MultisineExperiment("agreement", (joint,), chain=QUIET, seed=seed)
        estimate = best_linear(setting, replace(multisines, seed=seed))
        result = estimate.servo_agreement(truth)
        lines.append(result.p.ravel())
        whole.append(result.p_all.item())
        measured = estimate.servo.response
        exact = replace(measured, response=model.frequency_response(measured.frequencies))
        covered += bool(estimate.bandwidth.covers(response_bandwidth(exact).path()[0]).item())
    return np.concatenate(lines), np.array(whole), covered


def agreement_by_joint(seeds, multisines):
    """Print what the arm without friction gives."""
    heading("joint", "lines with p < 0.05, %", "p of uniform p", "seeds with p < 0.05", "intervals that hold the truth")
    truth = linearize(load_arm(friction=False))
    for joint in STUDIED_JOINTS:
        p, whole, covered = agreement(joint, seeds, multisines, truth)
        below = f"{100 * np.mean(p < 0.05):.1f} of {len(p)}", f"{kstest(p, 'uniform').pvalue:.2f}"
        row(joint, *below, f"{np.sum(whole < 0.05)} of {seeds}", f"{covered} of {seeds}")


def main():
    parser = options(__doc__)
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--joints", nargs="*", default=["shoulder_yaw", "elbow_pitch"])
    arguments = parser.parse_args()
    if arguments.seeds:
        agreement_by_joint(arguments.seeds, Multisines(realisations=8, period=5.12, f_min=0.1))
    for joint in arguments.joints:
        departures(joint, Multisines())


if __name__ == "__main__":
    main()
