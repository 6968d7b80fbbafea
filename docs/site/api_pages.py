"""Menu of the reference: every public name, parameters of the arm, measured tables. mkdocs calls it."""

import pkgutil
import re
from collections.abc import Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[2]
PACKAGES = ("sysid", "hmtb_twin", "scenarios")
ELSEWHERE = {"models/hmtb/README.md": "parameters.md", "CONTRIBUTING.md": "contributing.md"}
"""Files outside docs that are pages of the site."""


def public_packages() -> Iterator[tuple[str, list[str]]]:
    """Yield the packages that name what is public, and these names."""
    for name in PACKAGES:
        package = import_module(name)
        parts = [one.name for one in pkgutil.iter_modules(package.__path__, f"{name}.") if one.ispkg]
        for each in (name, *parts):
            if names := getattr(import_module(each), "__all__", None):
                yield each, sorted(names, key=str.lower)


def place(package: str, name: str) -> str:
    """Return the dotted path at which the reference documents a public name of a package."""
    own = getattr(import_module(package), name)
    for part, names in public_packages():
        if part.startswith(f"{package}.") and name in names and getattr(import_module(part), name) is own:
            return place(part, name)
    module = f"{package}.{name}"
    return f"{module}.{name}" if find_spec(module) and not isinstance(own, ModuleType) else module


def reference_page(package: str, names: list[str]) -> str:
    """Return the page of a package: names of its parts as links, its own with their docstrings."""
    links, own = [], []
    for name in names:
        at = place(package, name)
        if at.startswith(f"{package}.{name}"):
            own.append(f"::: {at}\n    options:\n      heading: {package}.{name}\n")
        else:
            links.append(f"[`{name}`][{at}]")
    return f"# {package}\n\n{(import_module(package).__doc__ or '').strip()}\n\n{', '.join(links)}\n\n" + "\n".join(own)


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Add the packages and the measured tables to the menu."""
    (reference,) = (section["Reference"] for section in config["nav"] if "Reference" in section)
    tables = sorted(path.name for path in (ROOT / "docs/measured").glob("*.md"))
    reference.append({"Measured tables": [f"measured/{name}" for name in tables]})
    reference.append({"Python": [{name: f"api/{name}.md"} for name, _ in public_packages()]})
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the reference of each package, and the pages from outside docs, to the site."""
    for path, page in ELSEWHERE.items():
        text = (ROOT / path).read_text(encoding="utf-8")
        files.append(File.generated(config, page, content=re.sub(r"\]\((?:\.\./)*docs/", "](", text)))
    for name, names in public_packages():
        files.append(File.generated(config, f"api/{name}.md", content=reference_page(name, names)))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Lead links out of docs to the pages of the site, leave the text of those to code, and rank tables last."""
    if page.file.src_uri.startswith("measured/"):
        page.meta["search"] = {"boost": 0.2}
    elif not page.file.src_uri.startswith("api/"):
        page.meta["search"] = {"boost": 2}
    for path, page in ELSEWHERE.items():
        markdown = markdown.replace(f"](../{path})", f"]({page})")
    return re.sub(r"\[([^\]]+)\]\(\.\./[^)]+\)", r"\1", markdown)
