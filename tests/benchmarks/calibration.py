"""Calibration of everything in `sysid` that claims a covariance: do errors have the distribution that is claimed?

`calibration_problems.py` has the records with known truth. Every claim gives a value of the probability integral
transform, which is uniform if the claim is right: the limit of the rank of the truth among many draws of the claimed
distribution, as simulation-based calibration has it [Talts2018]. A chi-square test over 20 bins sees claims that are
too narrow (values at both ends), too wide (in the middle) and biased (at one end); Kolmogorov and Smirnov's hardly sees
the first two. P-values of all quantities of all rows are adjusted together by Benjamini and Hochberg's procedure.

Criterion of 30 November 2026, when ten draws of each row had been seen, to learn what they cost: of every quantity,
95 % intervals (of a vector the 95 % region) hold the truth in 93 to 97 % of the draws in which the estimator gave no
warning. Two exceptions: intervals of `model_error`, which hold a union of claims, in 93 % at least; and a row of which
fewer than half of the draws are without warning is "warned", whatever the coverage. An estimator that refuses a record
with an error, or with an interval of NaN, does not count as wrong; a row of which every record is refused is
"refused". A departure from uniformity of adjusted p below 0.05 is "visible", and no
failure: 2,000 draws see terms of order 1/N that no user of an interval does.

"quantised output" judges the path, since rounding becomes a part of the disturbance. "repeating errors" judges against
the best linear system over many sequences, since the static nonlinearity has its linear part over them removed. It was
a cubic at first, whose outliers most estimators warned of; changed after 100 draws of `arx` and `armax`.

With fewer draws than 2,000, which decide nothing near the limits, a row fails where the 95 % interval of a coverage
lies outside of them as a whole, and is else "open"; added on the same day, before a run of more than 100 draws.

The same bits follow from the same seed with any number of processes. The journal has the outcomes of 100 draws of a
row on a line: the same command resumes from it, and more draws add to it. It knows nothing of the software: remove it
after a change of an estimator.
"""

import json
import zlib
from collections import Counter
from dataclasses import dataclass
from multiprocessing import Pool
from pathlib import Path

import matplotlib
import numpy as np
import scipy
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from sysid.plots.palette import BOUND, GRID, INK, PALETTE
from tests.benchmarks import tables
from tests.benchmarks.calibration_problems import PROBLEMS, all_cases, asked
from tests.benchmarks.tables import heading, percentage, row

CHUNK = 100
DRAWS = 2000
BINS = 20
LOWEST, HIGHEST = 0.93, 0.97
FEWEST_UNWARNED = 0.5
VISIBLE = 0.05
FREQUENT = 0.02  # share of draws from which a warning is listed
ONE_SIDED = "model_error"
DIGITS = 6

Outcome = tuple[dict[str, list], list[str], str]
"""Claims by quantity, texts of warnings, and the text of a refusal."""


def chunk(task):
    """Outcomes of some draws of a row, as the journal keeps them."""
    key, first, seed = task
    case = all_cases()[key]
    outcomes = []
    for k in range(first, first + CHUNK):
        claims, texts, refusal = asked(case, np.random.default_rng((seed, zlib.crc32(key.encode()), k)))
        rounded = {}
        for quantity, (*figures, holds) in claims.items():
            rounded[quantity] = [*(float(f"{figure:.{DIGITS}g}") for figure in figures), bool(holds)]
        outcomes.append((rounded, texts, refusal))
    return key, first, outcomes


def journal_of(path, seed, draws, keys):
    """Outcomes in the journal by row and first draw, those of this seed."""
    done: dict[tuple[str, int], list[Outcome]] = {}
    if path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            key, first, of_seed, outcomes = json.loads(line)
            if of_seed == seed and key in keys and first < draws:
                done[key, first] = outcomes
    return done


def measured(path, seed, draws, keys, processes):
    """Outcomes of all draws of all rows, those that the journal lacks computed and written to it."""
    done = journal_of(path, seed, draws, keys)
    # all rows of the first draws come first: an interrupted run has all rows
    wanted = [(key, first, seed) for first in range(0, draws, CHUNK) for key in keys if (key, first) not in done]
    path.parent.mkdir(parents=True, exist_ok=True)
    with Pool(processes) as pool, path.open("a", encoding="utf-8") as file:
        for key, first, outcomes in pool.imap_unordered(chunk, wanted):
            done[key, first] = outcomes
            file.write(json.dumps([key, first, seed, outcomes]) + "\n")
            file.flush()
    rows: dict[str, list[Outcome]] = {key: [] for key in keys}
    for key, first in sorted(done):
        rows[key] += done[key, first]
    return rows


@dataclass(frozen=True)
class Figures:
    """Figures of one quantity of a row, over the draws without a warning.

    Attributes:
        held: Intervals that hold the truth.
        draws: Draws that have the claim.
        bias: Mean error in claimed deviations; NaN where the claim has none.
        ratio: Median claimed deviation over that of the errors, 95 % of which lie within 3.92 of it.
        p_value: Of uniformity; NaN where there are no values of the transform.
    """

    held: int
    draws: int
    bias: float
    ratio: float
    p_value: float

    @property
    def coverage(self):
        """Share of intervals that hold the truth."""
        return self.held / self.draws

    def misses(self, highest, is_certain):
        """Whether the coverage is outside of the criterion; of few draws, its 95 % interval as a whole."""
        low = high = self.coverage
        if not is_certain:
            low, high = scipy.stats.binomtest(self.held, self.draws).proportion_ci(0.95, "wilson")
        return bool(high < LOWEST or low > highest)


def uniformity(values):
    """P-value of uniform values on 0 to 1, chi-square over equal bins."""
    counts = np.histogram(values, BINS, (0.0, 1.0))[0]
    return float(scipy.stats.chisquare(counts).pvalue)


def figures_of(claims):
    """Figures of the claims of one quantity."""
    z, deviation, probability, holds = np.array(claims, dtype=float).T
    bias = ratio = p_value = float("nan")
    known = np.isfinite(z)
    if known.sum() > BINS:
        errors = z[known] * deviation[known]
        # 95 % of normal values lie within 3.92 deviations
        realised = float(np.diff(np.quantile(errors, (0.025, 0.975)))[0]) / 3.92
        bias, ratio = float(z[known].mean()), float(np.median(deviation[known])) / realised
    if np.isfinite(probability).any():
        p_value = uniformity(probability[np.isfinite(probability)])
    return Figures(int(holds.sum()), len(holds), bias, ratio, p_value)


@dataclass(frozen=True)
class Row:
    """A row of the table: an estimator on a problem.

    Attributes:
        key: Problem and estimator.
        figures: By quantity, over the draws without a warning.
        warned: Share of the draws with a warning.
        refused: Number of records that the estimator refused.
        texts: Warnings and how often each came.
        coverage_of_all: Least coverage of a quantity over all draws, warned or not.
        draws: Records.
    """

    key: str
    figures: dict[str, Figures]
    warned: float
    refused: int
    texts: Counter
    coverage_of_all: float
    draws: int

    @property
    def problem(self):
        """Name of the problem."""
        return self.key.partition("/")[0]

    @property
    def estimator(self):
        """Name of the estimator."""
        return self.key.partition("/")[2]

    @property
    def failed(self):
        """Quantities whose coverage the criterion does not allow."""
        highest = 1.0 if self.estimator.startswith(ONE_SIDED) else HIGHEST
        is_certain = self.draws >= DRAWS
        return [name for name, of_quantity in self.figures.items() if of_quantity.misses(highest, is_certain)]

    @property
    def verdict(self):
        """What the criterion says of the row."""
        if not self.figures:
            return "refused"
        if self.warned > 1.0 - FEWEST_UNWARNED:
            return "warned"
        if self.failed:
            return "fails: " + ", ".join(self.failed)
        return "holds" if self.draws >= DRAWS else "open"


def row_of(key, outcomes):
    """Summary of the outcomes of a row."""
    answered = [(claims, texts) for claims, texts, refusal in outcomes if not refusal]
    if not answered:
        return Row(key, {}, 0.0, len(outcomes), Counter(), float("nan"), len(outcomes))
    texts = Counter(text for _, of_draw in answered for text in of_draw)
    warned = float(np.mean([bool(of_draw) for _, of_draw in answered]))
    quantities = answered[0][0]
    figures, coverages = {}, []
    for quantity in quantities:
        of_all = [claims[quantity] for claims, _ in answered]
        unwarned = [claims[quantity] for claims, of_draw in answered if not of_draw]
        figures[quantity] = figures_of(unwarned or of_all)
        coverages.append(float(np.mean([claim[3] for claim in of_all])))
    return Row(key, figures, warned, len(outcomes) - len(answered), texts, min(coverages), len(outcomes))


def adjusted(rows):
    """Adjusted p-values of uniformity, by row and quantity, of those that have one."""
    places = [(one.key, name) for one in rows for name, of_quantity in one.figures.items()]
    values = np.array([of_quantity.p_value for one in rows for of_quantity in one.figures.values()])
    known = np.isfinite(values)
    kept = [place for place, has_value in zip(places, known, strict=True) if has_value]
    return dict(zip(kept, scipy.stats.false_discovery_control(values[known]), strict=True))


def span(values, digits, factor=1.0):
    """Least and largest of some values as a text."""
    finite = [factor * value for value in values if np.isfinite(value)]
    if not finite:
        return "–"
    low, high = f"{min(finite):.{digits}f}", f"{max(finite):.{digits}f}"
    return low if low == high else f"{low} to {high}"


def print_problem(problem, rows, p_values):
    """Table of one problem, a row for each estimator."""
    of_problem = [one for one in rows if one.problem == problem]
    print(f"\n**{problem.capitalize()}**, {PROBLEMS[problem].samples} samples\n")
    columns = ("coverage, %", "claimed / realised", "mean error / claimed", "least adjusted p", "warned, %")
    heading("estimator", *columns, "coverage with warned draws, %", "verdict")
    for one in of_problem:
        values = list(one.figures.values())
        least = min((p_values[one.key, name] for name in one.figures if (one.key, name) in p_values), default=np.nan)
        row(
            one.estimator,
            span([value.coverage for value in values], 1, 100.0),
            span([value.ratio for value in values], 2),
            span([value.bias for value in values], 2),
            "–" if np.isnan(least) else f"{least:.2g}",
            f"{100.0 * one.warned:.0f}",
            f"{100.0 * one.coverage_of_all:.1f}" if one.warned else "",
            one.verdict,
        )


def print_failures(rows, p_values):
    """Every quantity that misses the criterion, with its interval."""
    print("\n**What misses the criterion**\n")
    heading(
        "problem", "estimator", "quantity", "coverage, %", "claimed / realised", "mean error / claimed", "adjusted p"
    )
    for one in rows:
        for name in one.failed if one.verdict.startswith("fails") else ():
            value = one.figures[name]
            p_value = p_values.get((one.key, name), np.nan)
            figures = (f"{value.ratio:.2f}", f"{value.bias:.2f}", f"{p_value:.2g}")
            texts = ["–" if text == "nan" else text for text in figures]
            row(one.problem, one.estimator, name, percentage(value.held, value.draws), *texts)


def print_warnings(rows, draws):
    """Warnings that came often, with the rows in which they did."""
    print("\n**Warnings in 2 % of the draws or more**\n")
    heading("warning", "rows, % of their draws")
    places: dict[str, list[str]] = {}
    for one in rows:
        for text, count in one.texts.items():
            if count >= FREQUENT * draws:
                places.setdefault(text, []).append(f"{one.problem}, {one.estimator} ({100.0 * count / draws:.0f})")
    for text, listed in sorted(places.items()):
        row(text, "; ".join(listed))


def drawn(rows, path):
    """Figure: coverage of every quantity, estimators down the page, problems side by side."""
    # text as text keeps the file small; the same ids on every run keep its differences small
    matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "calibration", "font.family": "sans-serif"})
    names = _listed(rows)
    figure = Figure(figsize=(12.0, 0.245 * len(names) + 1.5), layout="constrained")
    grid = figure.subplots(1, len(PROBLEMS), sharey=True)
    for axes, problem in zip(grid, PROBLEMS, strict=True):
        axes.axvspan(100.0 * LOWEST, 100.0 * HIGHEST, color=GRID, alpha=0.6, lw=0.0, zorder=0)
        axes.axvline(95.0, color=BOUND.colour, lw=BOUND.width, ls=BOUND.line, zorder=1)
        for one in rows:
            if one.problem == problem:
                _draw_row(axes, one, names.index(one.estimator))
        axes.set(xlim=(EDGE - 1.5, 100.8), ylim=(len(names) - 0.4, -0.6), xticks=(80, 85, 90, 95, 100))
        axes.set_title(problem, fontsize=10)
        axes.grid(axis="y", color=GRID, lw=0.5)
        axes.tick_params(labelsize=8.5, length=0)
        axes.spines[["top", "right", "left"]].set_visible(False)
    grid[0].set_yticks(range(len(names)), names)
    figure.supxlabel("truths inside 95 % intervals, % of the draws without a warning", fontsize=9.5)
    figure.legend(handles=_legend(), loc="outside upper center", ncols=4, fontsize=8.5, frameon=False)
    figure.savefig(path, metadata={"Date": None})


EDGE = 80.0
"""Lowest coverage on the axis, %; lower ones stand at the edge with their number."""


def _method(name):
    """Method of an estimator, without its options."""
    return name.partition(",")[0].partition(" ")[0]


def _listed(rows):
    """Names of the estimators, those of one method one below the other."""
    names = list(dict.fromkeys(one.estimator for one in rows))
    methods = list(dict.fromkeys(map(_method, names)))
    return sorted(names, key=lambda name: methods.index(_method(name)))


def _colour(name):
    """Colour of the method of that name, or of the batch method of a recursive one."""
    method = _method(name)
    return PALETTE.get(method, PALETTE.get(method.removeprefix("r"), PALETTE["measured"])).colour


def _draw_row(axes, one, height):
    """Coverages of the quantities of one row; those below the axis stand at its edge, the least as a number."""
    coverages = 100.0 * np.array([value.coverage for value in one.figures.values()])
    colour = _colour(one.estimator)
    is_warned = one.verdict == "warned"
    faces = "none" if is_warned else colour
    inside = coverages[coverages >= EDGE]
    axes.scatter(
        inside, np.full(len(inside), height), 20, facecolors=faces, edgecolors=colour, linewidths=1.0, zorder=3
    )
    if len(inside) < len(coverages):
        axes.scatter([EDGE - 0.5], [height], 24, marker="<", facecolors=faces, edgecolors=colour, zorder=3)
        axes.annotate(f"{coverages.min():.0f}", (EDGE + 0.6, height), fontsize=7.5, va="center", color=INK)


def _legend():
    """What bands and markers mean."""
    ink = {"color": INK, "lw": 0.0, "markersize": 5}
    return [
        Line2D([], [], marker="o", label="a parameter, gain, bandwidth, or all parameters", **ink),
        Line2D([], [], marker="o", markerfacecolor="none", label="most draws warned", **ink),
        Line2D([], [], marker="<", label="least coverage, below the axis", **ink),
        Line2D([], [], color=GRID, lw=6.0, label="criterion, 93 to 97 %"),
    ]


def main():
    parser = tables.options(__doc__)
    parser.add_argument("--draws", type=int, default=DRAWS, help=f"records of each row, a multiple of {CHUNK}")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--journal", type=Path, default=Path("build/calibration.jsonl"))
    parser.add_argument("--figure", type=Path, help="SVG file to write")
    parser.add_argument(
        "--only", nargs="+", default=[""], metavar="WORD", help="rows whose name holds one of the words"
    )
    asked_for = parser.parse_args()
    if asked_for.draws < CHUNK or asked_for.draws % CHUNK:
        parser.error(f"--draws: expected a multiple of {CHUNK}, got {asked_for.draws}")
    keys = [key for key in all_cases() if any(word in key for word in asked_for.only)]
    outcomes = measured(asked_for.journal, asked_for.seed, asked_for.draws, keys, asked_for.processes)
    rows = [row_of(key, of_row) for key, of_row in outcomes.items()]
    p_values = adjusted(rows)
    verdicts = Counter(one.verdict.partition(":")[0] for one in rows)
    visible = sum(p_value < VISIBLE for p_value in p_values.values())
    counts = ", ".join(f"{verdicts[name]} {name}" for name in ("holds", "fails", "warned", "refused", "open"))
    print(f"{asked_for.draws} draws of each of {len(rows)} rows: {counts}.", end=" ")
    print(f"Of {len(p_values)} tests of uniformity, {visible} see a departure.")
    for problem in PROBLEMS:
        if any(one.problem == problem for one in rows):
            print_problem(problem, rows, p_values)
    print_failures(rows, p_values)
    print_warnings(rows, asked_for.draws)
    if asked_for.figure:
        drawn(rows, asked_for.figure)


if __name__ == "__main__":
    main()
