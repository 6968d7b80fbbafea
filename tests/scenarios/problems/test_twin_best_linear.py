import numpy as np
from scipy.stats import f

from scenarios.bench.amplitude_split import AMPLITUDES, JOINTS, multisine_class
from scenarios.bench.bandwidth import sequence_class
from scenarios.problems import twin_best_linear as module
from scenarios.problems.twin_best_linear import (
    TABLE_CLASSES,
    BestLinear,
    class_key,
    measured_best_linear,
    twin_best_linear,
)
from scenarios.problems.twin_name import twin_name
from scenarios.problems.twin_records import FOLDER

ELBOW = "twin-nominal-elbow_pitch-multisine-40mrad"


def test_the_table_holds_all_that_the_quick_figures_compare_with():
    quick = {multisine_class(joint, mrad) for joint in JOINTS for mrad in AMPLITUDES["quick"]}
    assert set(TABLE_CLASSES) == quick | {sequence_class(joint) for joint in JOINTS} == set(module._table())


def test_a_measurement_of_today_agrees_with_the_table(monkeypatch):
    name = twin_name(ELBOW)
    known = twin_best_linear(name)
    monkeypatch.setattr(module, "SEED", module.SEED + 1)
    today = measured_best_linear(name, realisations=3)
    np.testing.assert_allclose(today.frequencies, known.frequencies)
    variance = known.variance * (known.realisations / today.realisations) + known.variance
    ratio = np.mean(np.abs(today.response - known.response) ** 2 / variance)
    lines = len(known.frequencies)
    # a few lines go together, so the limits are those of half as many
    assert f.ppf(1e-4, lines, lines * 20) < ratio < f.isf(1e-4, lines, lines * 20)


def test_one_that_the_table_does_not_hold_is_measured_and_kept(monkeypatch, tmp_path):
    monkeypatch.setenv(FOLDER, str(tmp_path))
    monkeypatch.setattr(module, "REALISATIONS", 2)
    measured = []

    def measure(name):
        measured.append(name)
        return measured_best_linear(name, realisations=2)

    monkeypatch.setattr(module, "measured_best_linear", measure)
    name = twin_name("twin-nominal-elbow_pitch-multisine-30mrad")
    first = twin_best_linear(name)
    module._of_class.cache_clear()
    again = twin_best_linear(name)
    assert measured == [name]
    np.testing.assert_allclose(again.response, first.response, rtol=1e-4)
    assert list(tmp_path.glob(f"*{class_key(name)}*"))
    assert BestLinear.from_table(again.to_table()).bandwidth_hz == again.bandwidth_hz
