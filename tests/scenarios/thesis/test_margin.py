"""What is a tie and what is a lead."""

import pytest

from scenarios.thesis.margin import MARGIN, ahead, said, tied


@pytest.mark.parametrize(
    ("difference", "word"),
    [(0.006, "tied"), (-0.19, "tied"), (0.21, "ahead"), (-0.21, "behind"), (MARGIN, "ahead"), (-MARGIN, "behind")],
)
def test_a_small_difference_is_a_tie(difference: float, word: str) -> None:
    assert said(difference) == word
    assert tied(difference) == (word == "tied")
    assert ahead(difference) == (word == "ahead")
