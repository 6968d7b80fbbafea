from dataclasses import replace

import numpy as np
import pytest

from scenarios.identification.comparison_figures import FIGURES, StyledModel, side_by_side
from scenarios.identification.file_identification import IdentificationRequest
from scenarios.identification.model_display import identify_request, model_list


@pytest.mark.slow
def test_models_of_other_channels_or_records_are_left_out_with_a_line(tmp_path):
    rng = np.random.default_rng(0)
    u, y = rng.standard_normal((500, 2)), np.zeros((500, 2))
    for k in range(1, 500):
        y[k] = [0.9, 0.6] * y[k - 1] + [0.1, 0.2] * u[k - 1]
    y += 0.01 * rng.standard_normal(y.shape)
    path, names = tmp_path / "two.csv", ("a", "b", "x", "z")
    table = np.column_stack((0.02 * np.arange(500), u, y))
    np.savetxt(path, table, delimiter=",", header=",".join(("t", *names)), comments="")
    both = {"input": ("a", "b"), "output": ("x", "z")}
    options = {
        "two": {"method": "n4sid", "orders": (2,), **both},
        "half": {"method": "okid", "orders": (2, 4), "held_out": 0.5, **both},
        "one": {"method": "arx", "orders": (1, 1), "input": ("a",), "output": ("x",)},
    }
    models = {name: identify_request(IdentificationRequest((path,), words)) for name, words in options.items()}
    drawn = [StyledModel(replace(model.judged, label=name), model.style) for name, model in models.items()]
    figures = side_by_side(drawn, (), 4.8)
    assert tuple(figures) == FIGURES
    texts = {title: [item for item in items if isinstance(item, str)] for title, items in figures.items()}
    assert texts["Bode"] == ["a → x", "b → x", "a → z", "b → z", "one is not drawn: its channels are others"]
    left_out = [f"{name} is not drawn: another record judges it" for name in ("half", "one")]
    assert texts["Fit"][-2:] == left_out
    assert [len(figures[title]) - len(texts[title]) for title in FIGURES] == [4, 2, 5, 2]
    two = models["two"]
    assert (two.known, two.remarks) == ((), ())
    assert ">several<" in model_list([two], two.known)
