"""The maps as a folder: one page that needs nothing else, a figure and a table of each."""

from html import escape
from pathlib import Path

import matplotlib

from scenarios.files.atomic_write import write_whole
from scenarios.report.drawing import SETTINGS, save_figure, svg
from scenarios.truth.map_figures import map_figures
from scenarios.truth.map_findings import findings
from scenarios.truth.map_tables import map_tables
from scenarios.truth.maps import Maps
from scenarios.truth.truth_summary import conditions_in_words

STYLE = """body { font: 16px/1.5 "Charter", "Source Serif 4", Cambria, Georgia, serif; color: #1d2327;
  max-width: 1000px; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; } figure { margin: 2rem 0; } svg { width: 100%; height: auto; }
figcaption, .files { font: 0.9rem/1.45 "Inter", "Segoe UI", Arial, sans-serif; color: #58626a; }
li { margin: 0.4rem 0; }"""
"""How the page looks."""


def write_maps(maps: Maps, folder: Path) -> tuple[Path, ...]:
    """Write the page, its figures as SVG and the tables behind them as CSV.

    Args:
        maps: The maps.
        folder: Where; files of the same names are replaced.

    Returns:
        The files, the page first.

    Raises:
        OSError: A file cannot be written.
    """
    figures = map_figures(maps)
    tables = map_tables(maps)
    page = folder / "maps.html"
    written = [page]
    pictures = {}
    for name, (figure, description) in figures.items():
        path = folder / f"{name}.svg"
        with matplotlib.rc_context(SETTINGS):
            save_figure(figure, path)
        pictures[name] = svg(figure, description, name)
        written.append(path)
    for name, text in tables.items():
        path = folder / f"{name}.csv"
        write_whole(path, text)
        written.append(path)
    captions = {name: description for name, (_, description) in figures.items()}
    write_whole(page, _page(maps, pictures, captions, sorted(tables)))
    return tuple(written)


def _page(maps: Maps, pictures: dict[str, str], captions: dict[str, str], tables: list[str]) -> str:
    truth = maps.truth
    title = f"Maps of the arm {truth.variant} with payload {truth.payload}"
    setting = f"Operating pose {truth.pose}; {conditions_in_words(maps.arm)}."
    said = "\n".join(f"<li>{escape(text)}</li>" for text in findings(maps))
    drawn = "\n".join(
        f"<figure>{picture}<figcaption>{escape(captions[name])}</figcaption></figure>"
        for name, picture in pictures.items()
    )
    linked = ", ".join(f'<a href="{name}.csv">{name}.csv</a>' for name in tables)
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(title)}</title><style>{STYLE}</style></head><body>
<h1>{escape(title)}</h1>
<p>{escape(setting)} Small-signal numbers are those of the arm linearised with dry friction off; what depends on
amplitude is its best linear approximation.</p>
<ul>
{said}
</ul>
{drawn}
<p class="files">Tables: {linked}. Made with {escape(", ".join(f"{k} {v}" for k, v in truth.provenance.items()))}.</p>
</body></html>
"""
