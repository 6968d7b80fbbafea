"""Tables of data sets, of scores of predictions and baselines, and of grades."""

from collections.abc import Mapping, Sequence

from scenarios.datasets.canonical import Canonical
from scenarios.datasets.grade import Grade
from scenarios.datasets.plan import DataSetPlan
from scenarios.datasets.score import Scores
from scenarios.files.result_table import ResultTable


def plan_table(plans: Mapping[str, DataSetPlan], built: Mapping[str, Canonical]) -> ResultTable:
    """Data sets by their labels, with what a build costs of those that a release has built."""
    rows = []
    for label, plan in plans.items():
        cost = built.get(label)
        size, build_time = (f"{cost.megabytes} MB", f"{cost.minutes:g} min") if cost else ("", "")
        title = plan.spec.title.removeprefix("HMTB twin: ")
        rows.append((label, str(len(plan)), f"{plan.seconds / 3600:.3g} h", size, build_time, title))
    columns = ("name", "experiments", "length", "size", "build (2 processors)", "title")
    return ResultTable("data sets", columns, rows)


def baseline_table(baselines: Sequence[Mapping[str, str]]) -> ResultTable:
    """Scores of baselines, from at least one row as it is published."""
    first = baselines[0]
    scores = [name for name in first if name == "test" or name.startswith("test_")] + ["validation"]
    horizon = "simulation" if first["steps"] == "0" else f"steps: {first['steps']}"
    rows = []
    for baseline in baselines:
        row = [baseline["method"], baseline["orders"]]
        for name in scores:
            row.append(f"{float(baseline[name]):.5g}" if baseline[name] else "")  # a failed baseline has no score
        rows.append(row)
    columns = ["method", "orders", *(name.replace("test_", "test\n") for name in scores)]
    return ResultTable(f"{first['metric']} / {first['unit']}, {horizon}", columns, rows)


def score_table(scores: Scores) -> ResultTable:
    """The score of each output of each record."""
    rule = scores.scoring
    rows = [(scored.experiment, scored.joint, f"{scored.value:.6g}") for scored in scores.scores]
    return ResultTable(f"{rule.metric} / {rule.unit}", ("record", "output", rule.metric), rows)


def grade_tables(graded: Mapping[str, Grade]) -> list[ResultTable]:
    """Scores of submissions by their names, and bandwidths of the models in them; none without submissions."""
    score_rows, model_rows = [], []
    for name, outcome in graded.items():
        method, best = outcome.best_baseline or ("-", None)
        attainable = "-" if outcome.attainable is None else f"{outcome.attainable:.4g}"
        best_score = "-" if best is None else f"{best:.4g}"
        remark = "better than the noise allows: copied?" if outcome.too_good else ""
        score_rows.append((name, f"{outcome.scores.mean:.4g}", attainable, method, best_score, remark))
        for model in outcome.models:
            bandwidths = (f"{model.bandwidth_hz:.4g}", f"{model.true_hz:.4g}", f"{model.error_percent:.3g}")
            stable = "" if model.stable else "no"
            model_rows.append((name, model.joint, *bandwidths, stable))
    tables = []
    if score_rows:
        rule = next(iter(graded.values())).scores.scoring
        columns = ("submission", f"{rule.metric} / {rule.unit}", "attainable", "best baseline", "its score", "remark")
        tables.append(ResultTable("scores", columns, score_rows))
    if model_rows:
        columns = ("submission", "joint", "bandwidth / Hz", "true, small-signal", "error / %", "stable")
        tables.append(ResultTable("models", columns, model_rows))
    return tables
