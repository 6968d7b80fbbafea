"""Make the pictures of the README: the arm, and the answer of the study. Run by `make images`."""

from pathlib import Path

import matplotlib
import matplotlib.image

from hmtb_twin import load_arm, render
from scenarios.experiments.campaign import NOMINAL
from scenarios.report.chart_drawing import draw
from scenarios.thesis.answer import answer_chart, measure_answer
from scenarios.thesis.study import run_study

FOLDER = Path(__file__).parent


def main() -> None:
    """Write `arm.png` and `result.png` beside this file."""
    matplotlib.use("Agg")
    matplotlib.image.imsave(FOLDER / "arm.png", render(load_arm(), "overview", 1200, 900))
    study = run_study(conditions=(NOMINAL,), thorough=False)
    chart = answer_chart(measure_answer(study))
    (panels,) = chart.views.values()
    draw(panels, chart.columns, name_marks=True).savefig(FOLDER / "result.png", dpi=130, bbox_inches="tight")


if __name__ == "__main__":
    main()
