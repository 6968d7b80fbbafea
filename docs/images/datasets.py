"""Make the gallery of data sets: a picture of each that comes with the package. Run by `make images`."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from scenarios.dataset_build.build import build
from scenarios.datasets.baselines_asked import BaselinesAsked
from scenarios.datasets.data_set import open_data_set
from scenarios.datasets.gallery import gallery_figure
from scenarios.datasets.spec import DataSetSpec, shipped
from scenarios.datasets.truth_asked import TruthAsked
from scenarios.drawing import save_figure

FOLDER = Path(__file__).parent / "datasets"
ARMS = 100
"""Randomised arms that are drawn for a picture: more make it no clearer."""


def main() -> None:
    """Write `<label>.png` of each data set into the folder `datasets` beside this file."""
    FOLDER.mkdir(exist_ok=True)
    for label, spec in shipped().items():
        with TemporaryDirectory() as folder:
            draw(build(pictured(spec), Path(folder)).path, FOLDER / f"{label}.png")


def pictured(spec: DataSetSpec) -> DataSetSpec:
    """As much of a data set as its picture shows: no baselines, and of a fleet some arms."""
    plain = replace(spec, truth=TruthAsked(floors=0), baselines=BaselinesAsked(models=()))
    return replace(plain, twins=replace(spec.twins, count=min(ARMS, spec.twins.count))) if spec.twins else plain


def draw(data_set: Path, path: Path) -> None:
    """Draw a data set that has been built."""
    save_figure(gallery_figure(open_data_set(data_set)), path, dpi=120)
    Image.open(path).convert("RGB").quantize(96).save(path, optimize=True)  # a third of the size, and no eye sees it


if __name__ == "__main__":
    main()
