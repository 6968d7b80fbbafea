"""A shared waveform spoils models of all nine responses, and those alone."""

from scenarios.experiments.joint_inputs import LIMIT
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.multi_input import ALONE, EXCITED, INDEPENDENT, METHODS, SHARED, off_diagonal


def test_independent_waveforms_find_what_a_shared_one_cannot(study: Comparison) -> None:
    found = {(entry.record, entry.method): entry for entry in study.multivariable.full}
    assert set(found) == {(record, method) for record in (SHARED, INDEPENDENT) for method in METHODS}
    true = off_diagonal(study.multivariable.truth, band=EXCITED)
    for method in METHODS:
        shared, independent = found[SHARED, method], found[INDEPENDENT, method]
        assert shared.condition > LIMIT > independent.condition
        if method == ALONE:
            assert shared.coupling == independent.coupling == 0.0
            assert shared.error < 2 * independent.error
        else:
            assert shared.error > 2 * independent.error
            assert abs(independent.coupling - true) < abs(shared.coupling - true)
