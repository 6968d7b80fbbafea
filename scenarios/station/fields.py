"""Forms of the page: fields, what is wrong beneath the field that is wrong, and the record that they describe."""

import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from html import escape
from itertools import groupby
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from hmtb_twin.files.errors import abridged
from scenarios.files.errors import ScenarioError
from scenarios.files.printable import one_line

if TYPE_CHECKING:
    import viser

T = TypeVar("T")

EXPECTED = (ValueError, OSError)
"""Errors that the reader of the page can mend; anything else is a fault of the program."""


@dataclass(frozen=True)
class Field:
    """One field of a form.

    Attributes:
        name: Key of its value.
        label: Words before it, with the unit: "amplitude / V".
        initial: First value. A truth value makes a checkbox, a number or text a line to type in, options a menu.
        options: Choices of a menu.
        hint: What the pointer shows.
        folder: Name of a closed folder that it lies in, with its neighbours of the same folder; empty for none.
        optional: Type of a number that may be left out: an empty line is None.
    """

    name: str
    label: str
    initial: bool | int | float | str | None
    options: tuple[str, ...] = ()
    hint: str | None = None
    folder: str = ""
    optional: type[int] | type[float] | None = None

    def read(self, typed: bool | str) -> bool | int | float | str | None:
        """Return the value of what was typed.

        Raises:
            ScenarioError: No number where one is expected.
        """
        if isinstance(typed, bool) or isinstance(self.initial, str):
            return typed
        if self.optional is not None and not typed.strip():
            return None
        type_of_initial = int if isinstance(self.initial, int) else float
        number_type = self.optional or type_of_initial
        try:
            return number_type(typed)
        except ValueError:
            expected = "a whole number" if number_type is int else "a number"
            if self.optional:
                expected += " or nothing"
            raise ScenarioError(f"expected {expected}, given {abridged(repr(typed))}") from None


class Form(Generic[T]):
    """Fields that describe a record together.

    Whenever a field changes, the record is made anew. If that fails, the error stands beneath every field that fails
    alone, with the other fields as they were when all was well, or beneath the form. Of what is typed while a record is
    made, only the last state is made next.

    Args:
        gui: Where to put it, in the container that is open.
        fields: The fields.
        make: Makes the record from the values by name; raises what `EXPECTED` lists.
        changed: Called with the record, or with None while something is wrong.
    """

    def __init__(
        self,
        gui: "viser.GuiApi",
        fields: Sequence[Field],
        make: Callable[[dict[str, Any]], T],
        changed: Callable[[T | None], None] = lambda record: None,
    ) -> None:
        self._fields = {field.name: field for field in fields}
        self._make, self._changed = make, changed
        self.handles: dict[str, Any] = {}
        self._messages: dict[str, Message] = {}
        self.folders: dict[str, Any] = {}
        for folder, together in groupby(fields, key=lambda field: field.folder):
            if folder:
                self.folders[folder] = gui.add_folder(folder, expand_by_default=False)
            with self.folders.get(folder, nullcontext()):
                for field in together:
                    handle = _input(gui, field)
                    self.handles[field.name] = handle
                    self._messages[field.name] = Message(gui)
                    handle.on_update(lambda _: self._typed())
        self._message = Message(gui)
        self._good: dict[str, Any] = {field.name: field.initial for field in fields}
        # Reentrant: `set` and `_typed` hold it while they call `update`, which takes it again.
        self._lock = threading.RLock()
        self._setting = False
        self._changes = 0

    def set(self, values: Mapping[str, Any]) -> None:
        """Put values into fields; the record is made anew once, if any of them is another."""
        with self._lock:
            before, self._setting = self._changes, True
            try:
                for name, value in values.items():
                    typed = value if isinstance(value, bool) else shown(value)
                    self.handles[name].value = typed
            finally:
                self._setting = False
            if self._changes != before:
                self.update()

    def update(self) -> T | None:
        """Make the record, say what is wrong, and return it; None while something is wrong."""
        with self._lock:
            record = self.record()
            self._changed(record)
            return record

    def record(self) -> T | None:
        """Make the record and say what is wrong; None while something is."""
        with self._lock:
            values, wrong = self._values()
            record, general = None, ""
            if not wrong:
                try:
                    record, self._good = self._make(values), values
                except EXPECTED as error:
                    # The record says what is wrong, not which field: each field is tried among values that were right.
                    alone = {name: self._alone(name, values) for name in values}
                    wrong = {name: message for name, message in alone.items() if message}
                    general = "" if wrong else str(error)
            for name, line in self._messages.items():
                line.say(wrong.get(name, ""))
            self._message.say(general)
            return record

    def checked(self) -> T:
        """Make the record.

        Raises:
            ScenarioError: A field is wrong.
        """
        record = self.record()
        if record is None:
            raise ScenarioError("a field is wrong: its message says what is expected")
        return record

    def _typed(self) -> None:
        # Every letter comes in a thread of its own; those that waited while a record was made need no record each.
        self._changes += 1
        change = self._changes
        with self._lock:
            if change == self._changes and not self._setting:
                self.update()

    def _values(self) -> tuple[dict[str, Any], dict[str, str]]:
        values, wrong = {}, {}
        for name, field in self._fields.items():
            try:
                values[name] = field.read(self.handles[name].value)
            except ScenarioError as error:
                wrong[name] = str(error)
        return values, wrong

    def _alone(self, name: str, values: Mapping[str, Any]) -> str:
        """What is wrong with one value among those that were right."""
        if values[name] == self._good[name]:
            return ""
        try:
            self._make({**self._good, name: values[name]})
        except EXPECTED as error:
            return str(error)
        return ""


class Message:
    """A line of text that is there only when it has something to say: an error in red, a remark in grey."""

    def __init__(self, gui: "viser.GuiApi") -> None:
        self._html = gui.add_html("", visible=False)
        self.text = ""

    def say(self, text: str, *, remark: bool = False) -> None:
        """Show a line; an empty one hides it."""
        self.text = text
        # Grey and red of Mantine, of which viser builds its pages.
        colour = "#868e96" if remark else "#e03131"
        # Errors quote names and contents of files: neither markup nor further lines of theirs reach the page.
        self._html.content = (
            f'<div style="color:{colour};font-size:0.8em;line-height:1.3;margin:-0.2em 0.75em 0.4em;'
            f'overflow-wrap:anywhere">{escape(one_line(abridged(text)))}</div>'
        )
        self._html.visible = bool(text)


def shown(value: object) -> str:
    """A value as it is typed: read again, it is the same."""
    if value is None:
        return ""
    # Ten digits hide the rounding of decimal fractions; a number that needs more is written in full.
    short = format(value, ".10g") if isinstance(value, float) else str(value)
    return repr(value) if isinstance(value, float) and float(short) != value else short


def _input(gui: "viser.GuiApi", field: Field) -> Any:
    if field.options:
        return gui.add_dropdown(field.label, field.options, initial_value=str(field.initial), hint=field.hint)
    if isinstance(field.initial, bool):
        return gui.add_checkbox(field.label, field.initial, hint=field.hint)
    return gui.add_text(field.label, shown(field.initial), hint=field.hint)


def reporting(client: "viser.ClientHandle", action: Callable[[], None]) -> Callable[[object], None]:
    """Return an event handler that shows in the browser what the action refuses."""

    def handle(_: object) -> None:
        try:
            action()
        except EXPECTED as error:
            reason = abridged(" ".join(str(error).split()))
            client.add_notification("Not done", reason, color="red", auto_close_seconds=15.0)

    return handle
