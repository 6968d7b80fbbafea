"""The section on every joint: what its table, its figure and its record say of the study's seven-joint model."""

import json
from dataclasses import replace

import numpy as np

from hmtb_twin import JOINTS
from scenarios.thesis.every_joint_section import LEAST, every_joint, every_joint_record, every_joint_section
from scenarios.thesis.report import html


def test_seven_joints_have_bandwidths_and_delays_and_the_strong_paths_are_significant(study):
    seven = study.every_joint
    assert [path.truth.name for path in seven.paths] == list(JOINTS)
    for path in seven.paths:
        # Friction slows a joint by up to a sixth.
        assert 0.8 < path.hz[0] / path.truth.bandwidth_hz < 1.05
    assert seven.significant[seven.true_gain > 0.01].all()
    assert seven.approximation.experiment.multisines.realisations == 2


def test_figure_and_record_tell_the_same(study):
    seven, chart = study.every_joint, every_joint(study)
    (panels,) = chart.views.values()
    assert [panel.title for panel in panels] == [f"{name.replace('_', ' ')} moves" for name in JOINTS]
    record = json.loads(json.dumps(every_joint_record(study), allow_nan=False))
    for i, panel in enumerate(panels):
        true, called, other = (np.asarray(one.x)[::-1] for one in panel.series)
        np.testing.assert_array_equal(np.isfinite(true), seven.coupled[i])
        np.testing.assert_array_equal(np.isfinite(called), record["coupling"]["significant"][i])
        np.testing.assert_array_equal(np.isfinite(called), ~np.isfinite(other))
        gains = np.where(np.isfinite(called), called, other)
        np.testing.assert_array_equal(gains, np.maximum(record["coupling"]["gain"][i], LEAST))
    assert record["joints"]["wrist_roll"]["true_delay"] == 2


def test_page_says_what_is_called_coupled_and_nothing_without_the_model(study, report):
    text = str(html(report)[0])
    values = every_joint_section(study)
    assert f"{values['coupled'] - len(values['missed'])} of 18 coupled paths are significant, and " in text
    assert "Fewer realisations than those of a whole study." in text
    without = replace(study, every_joint=None)
    assert (every_joint_section(without), every_joint_record(without), every_joint(without).views) == ({}, None, {})
    assert 'id="every-joint"' not in str(html(replace(report, every_joint={}, study=without))[0])
