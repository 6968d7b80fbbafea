"""What dry friction takes of the bandwidth at other slopes of the load-flow line than the straight line's.

The nominal arm assumes the straight line from no-load flow to stall; a spool near null has a few percent of its slope.
A flow servo falls short by friction times slope. For each slope the small-signal bandwidth, and the best linear one
under random-phase multisines of 0.05 to 5 Hz, 4 mrad rms, with its 95 % interval, and its gain at 1 Hz. Realisations
are added until the ends of the interval differ by 10 %, up to 64.
"""

import numpy as np

from hmtb_twin import STUDIED_JOINTS, Plant, linearize, load_arm
from scenarios.experiments.multisines import MultisineExperiment, Multisines
from scenarios.truth.best_linear import best_linear_as_needed
from tests.benchmarks.tables import heading, options, row

SLOPES = (1.0, 0.33, 0.1, 0.03)
RMS = 0.004


def main():
    parser = options(__doc__)
    parser.add_argument("--forms", nargs="+", default=["linear"], choices=["linear", "orifice"])
    parser.add_argument("--joints", nargs="+", default=list(STUDIED_JOINTS), choices=STUDIED_JOINTS)
    asked = parser.parse_args()
    heading("joint, actuator, slope", "small-signal, Hz", "best linear, Hz", "95 %", "gain at 1 Hz", "realisations")
    for form in asked.forms:
        for joint in asked.joints:
            for slope in SLOPES:
                plant = Plant(form, load_flow_slope=slope)
                true = linearize(load_arm(plant=plant), amplitudes=()).joint(joint).bandwidth_hz
                setting = MultisineExperiment(joint, (joint,), plant=plant, seed=1)
                found = best_linear_as_needed(setting, Multisines(rms=RMS, realisations=8, seed=1), narrow=1.1)
                hz, low, high = found.bandwidth.path()
                response = found.servo.response
                gain = np.interp(1.0, response.frequencies, response.magnitude[:, 0, 0])
                count = found.experiment.multisines.realisations
                label = f"{joint.replace('_', ' ')}, {form}, {slope:g}"
                row(label, f"{true:.2f}", f"{hz:.2f}", f"{low:.2f} to {high:.2f}", f"{gain:.2f}", count)


if __name__ == "__main__":
    main()
