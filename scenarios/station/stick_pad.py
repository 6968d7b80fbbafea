"""Keys and buttons of the hand controller on the page."""

from collections.abc import Callable, Mapping
from html import escape
from importlib import resources
from typing import TYPE_CHECKING, Any, Literal, cast

from hmtb_twin.control.modes import axis_names

if TYPE_CHECKING:
    import viser

PUSHES = 20.0
"""Pushes per second while a key or a button is held."""

KEYS = ("KI", "LJ", "OU", "RY", "GT", "FH")
"""Keys that push each axis back and forth; those that move the eye, W A S D Q E and the arrows, stay free."""

LET_GO: Literal["0"] = "0"
"""Key that lets go of all axes; released keys press it."""

# Without touch-action a finger that holds a button would scroll the page.
_GRID = """<div class="MARK"></div><style>
div:has(> div > .MARK) {display: grid; grid-template-columns: COLUMNS; gap: 5px; align-items: center}
div:has(> div > .MARK) {padding: 8px 12px 2px}
div:has(> div > .MARK) > div {margin: 0 !important; padding: 0 !important; min-width: 0}
div:has(> .MARK) {display: none}
div:has(> div > .MARK) button {padding: 0 2px; font-size: 0.75em; letter-spacing: -0.02em; touch-action: none}
</style>"""


class StickPad:
    """Keys and buttons of the hand controller; the keys act while no field has the cursor.

    Args:
        gui: Where to put it, in the container that is open.
        push: Called with an axis and its direction, -1 or 1, as long as it is pushed, and with 0 when it is released.
    """

    def __init__(self, gui: "viser.GuiApi", push: Callable[[str, int], None]) -> None:
        self._push, self._axes = push, ("",) * len(KEYS)
        script = resources.files("scenarios").joinpath("templates/stick.js").read_text(encoding="utf-8")
        # Escaped, since it stands inside the attribute of an element.
        script = escape(script.replace("PERIOD", str(1000.0 / PUSHES)).replace("LET_GO", LET_GO))
        # viser hands no script to a page; an element of its own can run one.
        gui.add_html(f'<img src="data:," alt="" style="display:none" onerror="{script}">')
        self._pads: dict[int, tuple[Any, ...]] = {}
        with gui.add_folder("Hand controller: hold buttons or keys"):
            grid(gui, "stick-pad", "44px 1fr 44px 44px 1fr 44px")
            for place in (0, 3, 1, 4, 2, 5):  # translations at the left, rotations at the right
                self._pads[place] = self._button(gui, place, -1), gui.add_html(""), self._button(gui, place, 1)
        gui.add_command("Let go of the hand controller", hotkey=LET_GO).on_trigger(lambda _: self._let_go())

    def _button(self, gui: "viser.GuiApi", place: int, way: int) -> Any:
        key, sign = KEYS[place][way > 0], "+" if way > 0 else "\N{MINUS SIGN}"
        button = gui.add_button(f"{sign} {key}", color="gray")
        command = gui.add_command(f"Push axis {place + 1} to {sign}", hotkey=cast(Any, key))
        for pushed in (button.on_hold(callback_hz=PUSHES), command.on_trigger):
            pushed(lambda _: self._push(self._axes[place], way))
        # A click is complete when the button is released.
        button.on_click(lambda _: self._let_go())
        return button

    def _let_go(self) -> None:
        for axis in self._axes:
            self._push(axis, 0)

    def show(self, mode: str, volts: Mapping[str, float]) -> None:
        """Show the axes of an experiment and their deflections, V."""
        self._axes = axis_names(mode)
        for place, axis in enumerate(self._axes):
            for handle in self._pads[place]:
                handle.visible = axis in volts
            # z: a deflection that is rounded to zero has no minus sign.
            words, number = axis.replace("_", " "), format(volts.get(axis, 0.0), "+z.1f")
            self._pads[place][
                1
            ].content = (
                f'<div style="text-align:center;font-size:0.8em;line-height:1.15">{words}<br><b>{number} V</b></div>'
            )


def grid(gui: "viser.GuiApi", mark: str, columns: str) -> None:
    """Put all that lies in the container that is open into a grid; its mark is unique, its columns are as in CSS."""
    gui.add_html(_GRID.replace("MARK", mark).replace("COLUMNS", columns))
