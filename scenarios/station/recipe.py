"""The folder of a tab with commands, Python and TOML that do the same without the page."""

from collections.abc import Callable
from html import escape
from typing import TYPE_CHECKING

from scenarios.experiments.recipe import Recipe

if TYPE_CHECKING:
    import viser

BUTTON = (
    "font:inherit;padding:0.1em 0.7em;cursor:pointer;color:inherit;"
    "background:transparent;border:1px solid #868e96;border-radius:4px"
)

CODE = (
    "margin:0.2em 0 0.7em;padding:0.5em 0.6em;background:rgba(134,142,150,0.14);border-radius:4px;font-size:0.8em;"
    "line-height:1.4;max-height:16em;overflow:auto"
)

COPY = (
    "navigator.clipboard.writeText(this.parentElement.nextElementSibling.textContent).then(() => {"
    "this.textContent = 'Copied'; setTimeout(() => {this.textContent = 'Copy'}, 1500)})"
)
"""Copies the text of the code below; the loopback address counts as secure."""


class RecipeView:
    """A folder that shows a recipe, copies it and saves its TOML.

    Args:
        client: The browser; the folder is put into the container that is open.
        recipe: Returns the recipe of now.
    """

    def __init__(self, client: "viser.ClientHandle", recipe: Callable[[], Recipe]) -> None:
        gui = client.gui
        self._recipe = recipe
        with gui.add_folder("The same as commands and Python", expand_by_default=False):
            self._text = gui.add_html("")
            self._save = gui.add_button("Save TOML")

            @self._save.on_click
            def _(_: object) -> None:
                recipe_now = self._recipe()
                client.send_file_download(recipe_now.file, recipe_now.toml.encode(), save_immediately=True)

        self.refresh()

    def refresh(self) -> None:
        """Show the recipe of now."""
        recipe = self._recipe()
        # Commands wrap, which copies as one line; lines of Python keep their beginnings and scroll.
        blocks = _block("Command line", recipe.shell, "pre-wrap") + _block("Python", recipe.python, "pre")
        content = blocks if recipe.commands else "Nothing was done yet."
        self._text.content = f'<div style="margin:0 0.75em">{content}</div>'
        self._save.visible = bool(recipe.toml)


def _block(title: str, code: str, wrap: str) -> str:
    if not code:
        return ""
    breaks = "anywhere" if wrap == "pre-wrap" else "normal"
    style = f"{CODE};white-space:{wrap};overflow-wrap:{breaks}"
    button = f'<button type="button" style="{BUTTON}" onclick="{escape(COPY)}">Copy</button>'
    return (
        f'<div style="display:flex;justify-content:space-between;font-size:0.8em">{title}{button}</div>'
        f'<pre style="{style}">{escape(code)}</pre>'
    )
