"""Recipes: what was done as commands, Python and TOML."""

import ast
import html
import re

from scenarios.experiments.recipe import Recipe
from scenarios.station.recipe import RecipeView
from tests.scenarios.station.conftest import press

AWKWARD = Recipe([["hmtb", "preview", "my file.toml"], ["hmtb", "list"]], 'print("<1 & 2>")', "x = 1\n", "my.toml")


def test_commands_and_python_are_shown_and_copied_to_the_letter(page):
    _, client = page
    view = RecipeView(client, lambda: AWKWARD)
    codes = re.findall(r"<pre[^>]*>(.*?)</pre>", view._text.content, re.DOTALL)
    assert [html.unescape(code) for code in codes] == ["hmtb preview 'my file.toml'\nhmtb list", 'print("<1 & 2>")']
    ast.parse(html.unescape(codes[1]))
    assert view._text.content.count("navigator.clipboard.writeText") == 2


def test_toml_is_saved_where_there_is_some(page):
    _, client = page
    recipes = [AWKWARD]
    view = RecipeView(client, lambda: recipes[-1])
    assert view._save.visible
    press(view._save)
    assert client.downloads == {"my.toml": b"x = 1\n"}
    recipes.append(Recipe([["hmtb"]], ""))
    view.refresh()
    assert not view._save.visible
    assert view._text.content.count("<pre") == 1
