"""Make the figures of docs/maps.md and their findings anew: `PYTHONPATH=. python docs/images/maps.py`."""

import re
from pathlib import Path

import matplotlib

from hmtb_twin import linearize, load_arm
from hmtb_twin.parameters.variants import OPERATING_POSE
from scenarios.truth.map_figures import map_figures
from scenarios.truth.map_findings import findings
from scenarios.truth.maps import Maps, maps
from scenarios.truth.truth_figure import truth_figure
from scenarios.truth.truth_summary import truth_summary

FOLDER = Path(__file__).parent
PAGE = FOLDER.parent / "measured" / "map-findings.md"
SHOWN = ("workspace", "locality", "coupling", "amplitude")


def main() -> None:
    """Write the figures beside this file and the sentences into the page."""
    # Text as text keeps the files small; the same ids on every run keep their differences small.
    matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "maps", "font.family": "sans-serif"})
    arm = load_arm()
    made = maps(arm, OPERATING_POSE)
    figures_of_maps = map_figures(made)
    figures = {f"maps-{name}.svg": figures_of_maps[name] for name in SHOWN}
    figures["truth.svg"] = truth_figure(truth_summary(arm, linearize(arm)))
    for name, figure in figures.items():
        figure.savefig(FOLDER / name, metadata={"Date": None})
    PAGE.write_text(renewed(PAGE.read_text(encoding="utf-8"), made), encoding="utf-8")


def renewed(page: str, made: Maps) -> str:
    """Return the page with its sentences made anew."""
    sentences = "\n".join(f"- {text}" for text in findings(made))
    block = re.compile(r"(<!-- findings -->\n).*?(<!-- end -->)", re.S)
    return block.sub(lambda match: f"{match[1]}{sentences}\n{match[2]}", page)


if __name__ == "__main__":
    main()
