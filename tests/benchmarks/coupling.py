"""How often the test of coupling calls paths without any, and finds those with: seven joints, campaign by campaign.

Every campaign has phases and noise of its own. First the paths without coupling: of the arm with its stick-slip
friction, which symmetry forbids, and of a surrogate that has none at all, seven linear joints side by side under the
same commands with the noise of the resolvers. Then every coupled path, and the seven joints. The best linear gain of a
path and bandwidth of a joint are those of the mean response of all other campaigns.
"""

from dataclasses import replace

import numpy as np

import sysid
from hmtb_twin import JOINTS, simulate
from scenarios.identification.every_joint import LEVEL, campaign, joint_model, seven_joints
from scenarios.report.figure_style import short
from scenarios.truth.best_linear import approximated
from sysid.frequency.band_gain import band_gain
from tests.benchmarks.tables import heading, options, percentage, row

LEVELS = (LEVEL, 0.05)


def surrogate(truth, logs, rng):
    """The logs as seven uncoupled linear joints would have them: small-signal truth of each, resolver noise."""
    channels = [truth.channel(name, name) for name in JOINTS]
    altered = []
    for log in logs:
        offsets = log.commanded - truth.angles
        moved = [sysid.simulate(one, offsets[:, [k]], rng=rng)[:, 0] for k, one in enumerate(channels)]
        altered.append(replace(log, measured=truth.angles + np.column_stack(moved)))
    return altered


def print_false_calls(name, p):
    """Print how many uncoupled paths the test calls coupled, by the p-values of campaigns (campaigns, paths)."""
    counts = [int((p < level).sum()) for level in LEVELS]
    cells = (f"{called}: {percentage(called, p.size, 2)}" for called in counts)
    row(name, p.size, *cells, int((p < LEVEL).any(axis=1).sum()))


def share(hits):
    """Text that says how many of several truth values hold."""
    return f"{int(np.sum(hits))} of {len(hits)}"


def main():
    parser = options(__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=1, help="first seed")
    chosen = parser.parse_args()
    models, plain = [], []
    for seed in range(chosen.first, chosen.first + chosen.seeds):
        experiments = campaign(seed=seed)
        logs = list(simulate(experiments, threads=1))
        models.append(seven_joints(experiments, logs))
        altered = surrogate(models[-1].approximation.small_signal, logs, np.random.default_rng([seed, 9]))
        alike = approximated(experiments, altered, JOINTS, physics_seconds=0.0, origin={})
        plain.append(band_gain(alike.servo).p[~np.eye(len(JOINTS), dtype=bool)])
    coupled, true = models[0].coupled, models[0].true_gain
    levels = (f"called at {100 * level:g} %: % (95 %)" for level in LEVELS)
    heading("arm", "paths tested", *levels, "campaigns with one")
    print_false_calls("with friction", np.array([one.coupling.p[~coupled] for one in models]))
    print_false_calls("uncoupled surrogate", np.array(plain))
    print()
    responses = np.array([one.approximation.servo.response.response for one in models])
    total = responses.sum(axis=0)
    others = [(total - one) / (len(models) - 1) for one in responses]
    heading("commanded", "moved", "true gain", "best linear", "called", "intervals hold true", "hold best linear")
    for i, j in np.argwhere(coupled & ~np.eye(len(JOINTS), dtype=bool)):
        linear = [float(np.sqrt(np.mean(np.abs(one[:, i, j]) ** 2))) for one in others]
        low, high = (np.array([getattr(one.coupling, end)[i, j] for one in models]) for end in ("low", "high"))
        held = (share((low <= gain) & (gain <= high)) for gain in (true[i, j], np.array(linear)))
        called = share([one.significant[i, j] for one in models])
        row(short(JOINTS[j]), short(JOINTS[i]), f"{true[i, j]:.2g}", f"{np.mean(linear):.2g}", called, *held)
    print()
    pooled = [replace(models[0].approximation.servo.response, response=one) for one in others]
    heads = ("joint", "true / Hz", "best linear / Hz", "of the model / Hz", "hold true", "hold best linear")
    heading(*heads, "without a model / Hz", "delay right")
    for k, path in enumerate(models[0].paths):
        rows = [one.paths[k] for one in models]
        hz, low, high = np.array([one.hz for one in rows]).T
        own, bare = path.truth.bandwidth_hz, [one.bare[0] for one in rows]
        linear = np.array([joint_model(one, path.truth.name, path.delay).bandwidth().path()[0] for one in pooled])
        row(
            short(path.truth.name),
            f"{own:.3f}",
            f"{linear.mean():.3f}",
            f"{hz.min():.3f} to {hz.max():.3f}",
            *(share((low <= value) & (value <= high)) for value in (own, linear)),
            f"{min(bare):.3f} to {max(bare):.3f}",
            share([one.delay == path.truth.delay_samples for one in rows]),
        )


if __name__ == "__main__":
    main()
