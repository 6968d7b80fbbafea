"""Make the gallery of data sets: a picture of each that comes with the package. Run by `make images`.

A picture carries the hash of what its data set is built from, so that a test can tell one that is of another spec.
"""

import json
import tomllib
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image
from PIL.PngImagePlugin import PngInfo

from scenarios.datasets.build import build
from scenarios.datasets.data_set import open_data_set
from scenarios.datasets.gallery import gallery_figure
from scenarios.datasets.spec import DataSetSpec, shipped
from scenarios.datasets.spec_tables import BaselineSpec, TruthSpec
from scenarios.report.drawing import save_figure

FOLDER = Path(__file__).parent / "datasets"
ARMS = 100
"""Randomised arms that are drawn for a picture: more make it no clearer."""

NOTE = "spec-sha256"
"""Name of the text in a picture that says of which spec it is."""

TOLD = ("title", "description", "creators", "keywords", "date", "url", "scoring", "truth", "baselines")
"""Keys of a spec that no picture depends on."""


def main() -> None:
    """Write `<label>.png` of each data set into the folder `datasets` beside this file."""
    FOLDER.mkdir(exist_ok=True)
    for label, spec in shipped().items():
        with TemporaryDirectory() as folder:
            draw(build(pictured(spec), Path(folder)).path, FOLDER / f"{label}.png", drawn_from(spec))


def pictured(spec: DataSetSpec) -> DataSetSpec:
    """As much of a data set as its picture shows: no baselines, and of a fleet some arms."""
    plain = replace(spec, truth=TruthSpec(floors=0), baselines=BaselineSpec(models=()))
    return replace(plain, twins=replace(spec.twins, count=min(ARMS, spec.twins.count))) if spec.twins else plain


def drawn_from(spec: DataSetSpec) -> str:
    """Hash of what the picture of a data set depends on: its pictured spec, but for what no number depends on."""
    table = tomllib.loads(pictured(spec).to_toml())
    numbers = {key: value for key, value in table.items() if key not in TOLD}
    return sha256(json.dumps(numbers, sort_keys=True).encode()).hexdigest()


def draw(data_set: Path, path: Path, spec_hash: str) -> None:
    """Draw a data set that has been built, and note in the picture what it was built from."""
    save_figure(gallery_figure(open_data_set(data_set)), path, dpi=120)
    note = PngInfo()
    note.add_text(NOTE, spec_hash)
    # A third of the size, and no eye sees it.
    Image.open(path).convert("RGB").quantize(96).save(path, optimize=True, pnginfo=note)


if __name__ == "__main__":
    main()
