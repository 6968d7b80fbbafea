"""Pictures of arms, and the table of docs/measured/arms.md: `python docs/images/arms.py`."""

from pathlib import Path

import numpy as np
from PIL import Image

from hmtb_twin import linearize, load_arm, render
from hmtb_twin.parameters.variants import NUMBERS

ARMS = ("nominal", "flight", "panda", "ur5", "ur10", "xarm7", "kinova", "z1", "so100", "talos_left_arm")
"""The arms of the table: two of the test bed, the others from example-robot-data."""

DOCS = Path(__file__).parents[1]
PICTURES = DOCS / "images" / "arms"

HEAD = """# Arms

Bandwidths are those of small signals at the operating pose (`hmtb truth --arm NAME`), friction is Coulomb torque. Of
the test bed [the model's own page](../../models/hmtb/README.md) says which numbers are assumed; of the others
`hmtb truth` lists them. `python docs/images/arms.py` renews this page.

| | arm | joints | moving mass / kg | drives | bandwidth / Hz | friction / N m | numbers assumed |
|---|---|---|---|---|---|---|---|
"""


def span(values):
    """Smallest and largest of some values, in three digits."""
    low, high = (f"{value:.3g}" for value in (min(values), max(values)))
    return low if low == high else f"{low} to {high}"


def row(name):
    """One row of the table, and the picture of its arm."""
    arm = load_arm(name)
    truth = linearize(arm, amplitudes=())
    free = arm.description.free
    picture = render(arm, width=640, height=480)
    PICTURES.mkdir(exist_ok=True)
    Image.fromarray(picture).resize((240, 180)).save(PICTURES / f"{name}.png", optimize=True)
    numbers = arm.description.numbers or NUMBERS[name]
    assumed = sum(row.tag == "assumed" for row in numbers)
    mass = float(np.sum(arm.model.body_mass))
    cells = [
        f"![{name}](../images/arms/{name}.png)",
        f"`{name}`",
        f"{len(free)}",
        f"{mass:.3g}",
        arm.drives_kind,
        span([truth.joint(joint).bandwidth_hz for joint in free]),
        span([arm.drives[joint].coulomb_torque for joint in free]),
        f"{assumed} of {len(numbers)}",
    ]
    return f"| {' | '.join(cells)} |\n"


def preview():
    """The picture of the model's own folder, as collections of models have it."""
    picture = render(load_arm(), width=960, height=720)
    place = DOCS.parent / "models" / "hmtb" / "hmtb.png"
    Image.fromarray(picture).resize((640, 480)).save(place, optimize=True)


if __name__ == "__main__":
    preview()
    (DOCS / "measured" / "arms.md").write_text(HEAD + "".join(map(row, ARMS)), encoding="utf-8")
