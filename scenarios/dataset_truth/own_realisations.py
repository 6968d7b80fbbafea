"""Records of a data set that are themselves a measurement of a best linear approximation."""

from pathlib import Path

import numpy as np

from hmtb_twin import JointLog
from scenarios.dataset_truth.excitation_class import excitation_class
from scenarios.dataset_truth.stored_log import stored_log
from scenarios.datasets.plan import Entry, Plan
from scenarios.multisine_experiment import MultisineExperiment


def own_realisations(plan: Plan, folder: Path, entry: Entry) -> tuple[tuple[MultisineExperiment, JointLog], ...]:
    """The realisations of a multisine that a data set has of the class of an experiment, on the same arm.

    Random-phase multisines of one class differ by their phases alone, whatever part of the data set they belong to.

    Args:
        plan: The experiments.
        folder: Where their records stand.
        entry: An experiment.

    Returns:
        Experiments and their logs, realisation by realisation, each phase once; none where something else is played.
        A realisation of which a record is missing does not count.

    Raises:
        ScenarioError: A damaged file.
    """
    if not isinstance(entry.experiment, MultisineExperiment):
        return ()
    lines, wanted = entry.experiment.multisines.lines, excitation_class(entry)
    whole: dict[tuple[int, int], dict[int, tuple[Entry, MultisineExperiment]]] = {}
    size = len(plan) // plan.twins
    begin = size * (entry.twin or 0)
    for other in plan[begin : begin + size]:
        one = other.experiment
        # Odd multisines draw their silent lines, too: only those of one seed have the same.
        if not isinstance(one, MultisineExperiment) or excitation_class(other) != wanted:
            continue
        if np.array_equal(one.multisines.lines, lines) and (folder / other.data).is_file():
            whole.setdefault((one.multisines.seed, one.realisation), {}).setdefault(one.record, (other, one))
    return tuple(
        (one, stored_log(folder, other))
        for records in whole.values()
        if len(records) == len(entry.experiment.axes)
        for _, (other, one) in sorted(records.items())
    )
