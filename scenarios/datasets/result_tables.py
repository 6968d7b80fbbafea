"""Tables of scores of predictions and of grades."""

from collections.abc import Mapping

from scenarios.datasets.grade import Grade
from scenarios.datasets.score import Scores
from scenarios.files.result_table import ResultTable


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
