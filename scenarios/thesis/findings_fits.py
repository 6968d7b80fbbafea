"""Findings of chapter VI on how the three-joint models follow data, each decided in simulation and one step ahead."""

from collections.abc import Iterable, Mapping
from statistics import median

import numpy as np

import sysid
from hmtb_twin import STUDIED_JOINTS
from scenarios.thesis.about_1_hz import ABOUT_1_HZ
from scenarios.thesis.both_ways import WORDS, both_ways, without_noise_model
from scenarios.thesis.campaign import RPCM
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.finding import Finding, decided, verdict
from scenarios.thesis.multi_input import EXCITED, FULL_OKID, INDEPENDENT
from scenarios.thesis.multivariable import FAST_CHIRP, LAGS, WAYS, Kind, ThreeJointModel, Way
from sysid import ResidualTest

YAW, SHOULDER, ELBOW = STUDIED_JOINTS

SLOW = ("mimo-10", "mimo-11")
"""Data of low frequency: the sweeps that begin at 0 Hz."""

MIDDLE = ((1, 2, 3), ("mimo-1", "mimo-2", "mimo-4", "mimo-5", "mimo-11"))
"""Single-joint tests and records of several joints with content at 3 to 5 Hz, and none above."""

FAST = ((4, 8), ("mimo-3", "mimo-6", "mimo-12", "mimo-13"))
"""Those with content above 5 Hz."""

FOLLOWS = 80.0
"""A model follows a record that it fits better, percent."""

SLIGHTLY = 10.0
"""Slightly better means by no more, percentage points."""

FAIRLY_WHITE = 0.2
"""Fairly white: no more than this share of the lags outside the 99 % bounds."""

KINDS: tuple[Kind, ...] = ("SysID", "OKID")

SLIGHT = 0.1
"""A slight coupling lies outside the bounds and explains no more than this share of the residual's variance."""


def exchange_fit(study: Comparison) -> Finding:
    """F18: OKID follows the exchange better on every joint, SysID is worst on shoulder pitch."""
    study.campaign.log(RPCM)
    own, okid = study.multivariable.pair()
    ahead = {way: _ahead(own, okid, RPCM, way) for way in WAYS}
    worst = {way: min(fits, key=lambda joint: fits[joint]) for way in WAYS for fits in (own.fit(RPCM).of(way),)}
    passed = {way: sum(v > 0 for v in ahead[way].values()) + (worst[way] == SHOULDER) for way in WAYS}
    decision, said = both_ways(passed, len(STUDIED_JOINTS) + 1)
    return decided(
        "F18",
        decision,
        _named(ahead),
        "percentage points, fit of OKID less that of SysID to the exchange of the replacement unit",
        f"four parts: OKID ahead on each joint, SysID worst on shoulder pitch (worst is {_words(worst['simulation'])} "
        f"in simulation, {_words(worst['one_step'])} one step ahead). {said[0].upper()}{said[1:]}; "
        f"{without_noise_model(own)}. {_departure(study)} The printed models: {_printed(study, RPCM)}",
    )


def exchange_residuals(study: Comparison) -> Finding:
    """F19: which residuals of the exchange are white, and how long yaw's depend on the input."""
    study.campaign.log(RPCM)
    tests = [entry.residual_test(RPCM) for entry in study.multivariable.pair()]
    own, okid = (outside_share(test) for test in tests)
    early, late = zip(*(dependence(test) for test in tests), strict=True)
    parts = [
        own[YAW] <= FAIRLY_WHITE,
        own[ELBOW] <= FAIRLY_WHITE,
        own[SHOULDER] > FAIRLY_WHITE,
        okid[YAW] <= FAIRLY_WHITE,
        okid[SHOULDER] <= FAIRLY_WHITE,
        okid[ELBOW] > max(okid[YAW], okid[SHOULDER]),
        *(first > 0 and second <= FAIRLY_WHITE for first, second in zip(early, late, strict=True)),
    ]
    first = [float(np.abs(np.diag(np.asarray(test.autocorrelation)[1])).min()) for test in tests]
    return decided(
        "F19",
        verdict(sum(parts), len(parts)),
        {
            **{f"SysID {joint}": 100 * share for joint, share in own.items()},
            **{f"OKID {joint}": 100 * share for joint, share in okid.items()},
            "SysID yaw and its input, lags 1 to 14": 100 * early[0],
            "SysID yaw and its input, lags 15 to 25": 100 * late[0],
            "OKID yaw and its input, lags 1 to 14": 100 * early[1],
            "OKID yaw and its input, lags 15 to 25": 100 * late[1],
        },
        f"percent of the lags 1 to {LAGS} of the residual's correlation outside the 99 % bounds, exchange",
        f"fairly white is up to {100 * FAIRLY_WHITE:.0f} % of the lags outside, where chance leaves 1 %; less white on "
        "elbow is a larger share there than on the others; at lags below 15 one outside at least. "
        f"{sum(parts)} of {len(parts)} parts hold: {len(tests[0].residuals)} samples make bounds of "
        f"{tests[0].whiteness_bound:.3f}, and the correlation at one lag alone is at least {first[0]:.2f} (SysID) and "
        f"{first[1]:.2f} (OKID): friction and slow motion leave errors that last, which no linear model of so few "
        "states whitens",
    )


def fast_chirp(study: Comparison) -> Finding:
    """F20: OKID follows the 5 to 10 Hz chirp better; the pitch inputs couple slightly into yaw's residuals."""
    data = study.campaign.several(FAST_CHIRP)
    own, okid = study.multivariable.pair()
    ahead = {way: _ahead(own, okid, FAST_CHIRP, way) for way in WAYS}
    peaks = {
        f"{entry.kind}, {_words(STUDIED_JOINTS[j])} input": peak(entry.residual_test(FAST_CHIRP), 0, j)
        for entry, inputs in ((own, (1,)), (okid, (1, 2)))
        for j in inputs
    }
    slight = sum(outside and value**2 <= SLIGHT for value, outside in peaks.values())
    passed = {way: sum(v > 0 for v in ahead[way].values()) + slight for way in WAYS}
    decision, said = both_ways(passed, len(STUDIED_JOINTS) + len(peaks))
    alike = min(abs(float(np.corrcoef(data.u[:, 0], data.u[:, j])[0, 1])) for j in (1, 2))
    unmoved = data.u.copy()
    unmoved[:, 0] = 0.0
    coupled = 100 * float(np.std(sysid.simulate(study.multivariable.truth, unmoved)[:, 0]) / np.std(data.y[:, 0]))
    return decided(
        "F20",
        decision,
        {**_named(ahead), **{f"yaw residual, {name}": value for name, (value, _) in peaks.items()}},
        "percentage points, fit of OKID less that of SysID; largest correlation of yaw's residual with a pitch input",
        f"six parts: OKID ahead on each joint; each of the thesis' three couplings outside the 99 % bounds, yet no "
        f"more than {100 * SLIGHT:g} % of the residual's variance. {said[0].upper()}{said[1:]}. The axes share a "
        f"waveform, so the commands are alike (correlation {alike:.3f} at least) and such a correlation may as well be "
        f"with yaw's own input: in truth the pitch commands make {coupled:.1f} % of yaw's motion "
        f"there{_told_apart(study)}. The printed models: {_printed(study, FAST_CHIRP)}",
    )


def slow_data(study: Comparison) -> Finding:
    """F21: on data of low frequency SysID is ahead on yaw and the hybrid model is best."""
    for record in SLOW:
        study.campaign.log(record)
    own, okid = study.multivariable.pair()
    hybrid = study.multivariable.model("hybrid")
    passed, yaw, best = {}, {}, {}
    for way in WAYS:
        lead = {record: -_ahead(own, okid, record, way)[YAW] for record in SLOW}
        gain = {
            record: hybrid.fit(record).mean(way) - max(own.fit(record).mean(way), okid.fit(record).mean(way))
            for record in SLOW
        }
        yaw[way] = lead
        best[way] = gain
        passed[way] = sum(v > 0 for v in lead.values()) + sum(v > 0 for v in gain.values())
    decision, said = both_ways(passed, 2 * len(SLOW))
    return decided(
        "F21",
        decision,
        {
            **{f"yaw, {name}": value for name, value in _named(yaw).items()},
            **{f"hybrid, {name}": value for name, value in _named(best).items()},
        },
        "percentage points, fit of SysID less that of OKID on yaw; mean fit of the hybrid model over the joints less "
        "that of the better of the two others",
        f"four parts, two for each of the sweeps that begin at 0 Hz ({', '.join(SLOW)}). {said[0].upper()}{said[1:]}; "
        f"{without_noise_model(own)}. Slow data weigh what no model was excited with: below 0.5 Hz they extrapolate, "
        f"and there their gains on yaw are {_gains(own)} (SysID) and {_gains(okid)} (OKID), truth 1.00",
    )


def follows_5_hz(study: Comparison) -> Finding:
    """F22: cutoff about 1 Hz, yet the models follow 3 to 5 Hz content."""
    low, high = ABOUT_1_HZ
    worst = {
        way: {
            joint: min(value for kind in KINDS for value in _followed(study, kind, joint, MIDDLE, way).values())
            for joint in study.joints
        }
        for way in WAYS
    }
    bands = {
        joint: (entry.chosen.bandwidth_hz, entry.models["okid"].bandwidth_hz) for joint, entry in study.joints.items()
    }
    near = sum(all(low <= hz <= high for hz in pair) for pair in bands.values())
    passed = {way: sum(value > FOLLOWS for value in worst[way].values()) + near for way in WAYS}
    decision, said = both_ways(passed, 2 * len(bands))
    which = [_least_followed(study, joint) for joint in study.joints]
    shown = ", ".join(f"{a:.2f} and {b:.2f}" for a, b in bands.values())
    return decided(
        "F22",
        decision,
        _named(worst),
        "percent, worst fit of both models to the records with content at 3 to 5 Hz and none above",
        f"six parts: both cutoffs of a joint about 1 Hz ({low:g} to {high:g}; they are {shown} Hz for SysID and OKID), "
        "by construction, since servo poles were placed after the published models; and both models above "
        f"{FOLLOWS:g} % on every record. {said[0].upper()}{said[1:]}. Worst in simulation are "
        f"{', '.join(which)}: a linear model still knows above its bandwidth by how much the arm lags, but "
        "not what friction takes from the smallest motions",
    )


def above_5_hz(study: Comparison) -> Finding:
    """F23: above 5 Hz OKID is slightly better."""
    found = {
        way: {
            joint: median(
                _followed(study, "OKID", joint, FAST, way)[name] - value
                for name, value in _followed(study, "SysID", joint, FAST, way).items()
            )
            for joint in study.joints
        }
        for way in WAYS
    }
    decision, said = both_ways(
        {way: sum(0 < v <= SLIGHTLY for v in found[way].values()) for way in WAYS}, len(study.joints)
    )
    own, _ = study.multivariable.pair()
    return decided(
        "F23",
        decision,
        _named(found),
        "percentage points, fit of OKID less that of SysID, median over the records with content above 5 Hz",
        f"slightly better is taken as above 0 and up to {SLIGHTLY:g} points, joint by joint. "
        f"{said[0].upper()}{said[1:]}; {without_noise_model(own)}",
    )


def outside_share(test: ResidualTest) -> dict[str, float]:
    """Share of the lags of a joint's residual outside the bounds."""
    lags = len(test.lags) - 1
    return {joint: float(test.outside_whiteness[i]) / lags for i, joint in enumerate(STUDIED_JOINTS)}


def dependence(test: ResidualTest) -> tuple[float, float]:
    """Share of lags 1 to 14, and from 15 on, at which yaw's residual and its input correlate beyond the bounds."""
    outside = np.abs(test.cross_correlation[:, 0, 0]) > test.independence_bound[0, 0]
    early, late = (test.cross_lags >= 1) & (test.cross_lags < 15), test.cross_lags >= 15
    return float(outside[early].mean()), float(outside[late].mean())


def peak(test: ResidualTest, output: int, source: int) -> tuple[float, bool]:
    """Largest correlation of a residual with an input's past, and whether it is outside the bounds."""
    value = float(np.abs(test.cross_correlation[test.cross_lags >= 0, output, source]).max())
    return value, value > test.independence_bound[output, source]


def _ahead(own: ThreeJointModel, okid: ThreeJointModel, record: str, way: Way) -> dict[str, float]:
    mine, other = own.fit(record).of(way), okid.fit(record).of(way)
    return {joint: other[joint] - mine[joint] for joint in mine}


def _followed(
    study: Comparison, kind: Kind, joint: str, records: tuple[Iterable[int], Iterable[str]], way: Way
) -> dict[str, float]:
    """Fits of a model to single-joint tests and records of several joints, those that are there."""
    entry, several = study.joints[joint], study.multivariable.model(kind)
    single = entry.models["okid"] if kind == "OKID" else entry.chosen
    alone = {f"siso-{n}": single.fits[n] for n in records[0] if n in single.fits}
    return {
        **{name: fit.simulation if way == "simulation" else fit.one_step for name, fit in alone.items()},
        **{name: several.fit(name).of(way)[joint] for name in records[1]},
    }


def _least_followed(study: Comparison, joint: str) -> str:
    """The model and record of a joint whose simulation follows least."""
    fits = {
        f"{_words(joint)} of {kind} on {name}": value
        for kind in KINDS
        for name, value in _followed(study, kind, joint, MIDDLE, "simulation").items()
    }
    name = min(fits, key=lambda entry: fits[entry])
    return f"{name} ({fits[name]:.0f} %)"


def _named(found: Mapping[Way, Mapping[str, float]]) -> dict[str, float]:
    return {f"{name}, {way.replace('_', ' ')}": value for way in WAYS for name, value in found[way].items()}


def _printed(study: Comparison, record: str) -> str:
    """How the printed models follow a record, in the same words."""
    own, okid = study.multivariable.pair(printed=True)
    counts = [f"{sum(v > 0 for v in _ahead(own, okid, record, way).values())} of 3 {WORDS[way]}" for way in WAYS]
    return f"OKID is ahead on {' and on '.join(counts)}"


def _departure(study: Comparison) -> str:
    found = study.multivariable.exchange
    if found is None:
        return ""
    away = {joint: np.degrees(found.departure[joint]) for joint in STUDIED_JOINTS}
    return (
        f"The arm goes up to {max(away.values()):.0f} degrees from the operating point and carries the unit "
        f"{100 * found.loaded:.0f} % of the time, but slowly."
    )


def _told_apart(study: Comparison) -> str:
    """What a model of all nine responses has from the pitches to yaw, where every axis has a waveform of its own."""
    found = [e for e in study.multivariable.full if (e.record, e.method) == (INDEPENDENT, FULL_OKID)]
    if not found:
        return ""
    rows = found[0].model.frequency_response(np.geomspace(*EXCITED, 200))[:, 0]
    share = 100 * float(np.linalg.norm(rows[:, 1:]) / np.linalg.norm(rows))
    return f"; identified where every axis has a waveform of its own, they have {share:.1f} % of yaw's response"


def _gains(model: ThreeJointModel) -> str:
    f = np.array([0.05, 0.2])
    low, high = np.abs(model.blocks[YAW].frequency_response(f)[:, 0, 0])
    return f"{low:.2f} at 0.05 Hz and {high:.2f} at 0.2 Hz"


def _words(joint: str) -> str:
    return joint.replace("_", " ")
