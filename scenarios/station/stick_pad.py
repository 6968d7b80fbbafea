"""Keys and buttons of the hand controller on the page."""

from collections.abc import Callable, Mapping, Sequence
from html import escape
from importlib import resources
from typing import TYPE_CHECKING, Any, Literal, cast

if TYPE_CHECKING:
    import viser

PUSHES = 20.0
"""Pushes per second while a key or a button is held."""

KEYS = ("KI", "LJ", "OU", "RY", "GT", "FH", "BN", "ZX")
"""Keys that push each axis back and forth; those that move the eye, W A S D Q E and the arrows, stay free. An axis
beyond these has buttons alone."""

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
        count: Most axes that a mode of the arm has.
    """

    def __init__(self, gui: "viser.GuiApi", push: Callable[[str, int], None], count: int = 6) -> None:
        self._push, self._axes = push, ("",) * count
        script = resources.files("scenarios").joinpath("templates/stick.js").read_text(encoding="utf-8")
        # Escaped, since it stands inside the attribute of an element.
        script = escape(script.replace("PERIOD", str(1000.0 / PUSHES)).replace("LET_GO", LET_GO))
        # viser hands no script to a page; an element of its own can run one.
        gui.add_html(f'<img src="data:," alt="" style="display:none" onerror="{script}">')
        self._pads: dict[int, tuple[Any, ...]] = {}
        with gui.add_folder("Hand controller: hold buttons or keys"):
            grid(gui, "stick-pad", "44px 1fr 44px 44px 1fr 44px")
            # Of six translations at the left, rotations at the right; of a long arm the first half at the left.
            half = (count + 1) // 2
            for place in (one for row in range(half) for one in (row, row + half) if one < count):
                self._pads[place] = self._button(gui, place, -1), gui.add_html(""), self._button(gui, place, 1)
        gui.add_command("Let go of the hand controller", hotkey=LET_GO).on_trigger(lambda _: self._let_go())

    def _button(self, gui: "viser.GuiApi", place: int, way: int) -> Any:
        sign = "+" if way > 0 else "\N{MINUS SIGN}"
        key = KEYS[place][way > 0] if place < len(KEYS) else ""
        button = gui.add_button(f"{sign} {key}".strip(), color="gray")
        pushes: list[Any] = [button.on_hold(callback_hz=PUSHES)]
        if key:
            pushes.append(gui.add_command(f"Push axis {place + 1} to {sign}", hotkey=cast(Any, key)).on_trigger)
        for pushed in pushes:
            pushed(lambda _: self._push_axis(place, way))
        # A click is complete when the button is released.
        button.on_click(lambda _: self._let_go())
        return button

    def _push_axis(self, place: int, way: int) -> None:
        if place < len(self._axes):
            self._push(self._axes[place], way)

    def _let_go(self) -> None:
        for axis in self._axes:
            self._push(axis, 0)

    def show(self, axes: Sequence[str], volts: Mapping[str, float]) -> None:
        """Show the axes of a mode and the deflections of those that are moved, V."""
        self._axes = tuple(axes)
        for place, handles in self._pads.items():
            if place >= len(axes):
                for handle in handles:
                    handle.visible = False
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
