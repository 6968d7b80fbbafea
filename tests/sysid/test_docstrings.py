"""Every public function says what it takes, what it returns, and what it refuses."""

import ast
import inspect
import re
import textwrap
from collections.abc import Callable, Iterator

import pytest

import sysid
import sysid.plots


def functions() -> Iterator[tuple[str, Callable[..., object]]]:
    """Public functions of the package and of its plots, and the public methods of its public classes."""
    rooms = (sysid.records, sysid.models, sysid.polynomial, sysid.validation, sysid.subspace, sysid.recursive)
    for package in (sysid, *rooms, sysid.frequency, sysid.plots):
        for name in package.__all__:
            thing = getattr(package, name)
            if inspect.isfunction(thing):
                yield f"{package.__name__}.{name}", thing
            elif inspect.isclass(thing):
                for own, member in vars(thing).items():
                    member = member.__func__ if isinstance(member, staticmethod | classmethod) else member
                    if not own.startswith("_") and inspect.isfunction(member):
                        yield f"{package.__name__}.{name}.{own}", member


PUBLIC = dict(functions())


@pytest.mark.parametrize("name", PUBLIC)
def test_sections(name: str) -> None:
    function = PUBLIC[name]
    text = inspect.getdoc(function) or ""
    parameters = [p for p in inspect.signature(function).parameters if p != "self"]
    (node,) = ast.parse(textwrap.dedent(inspect.getsource(function))).body
    raises = any(isinstance(part, ast.Raise) and part.exc is not None for part in ast.walk(node))
    method = name.split(".")[-2][0].isupper()
    if parameters and not method:
        assert "\nArgs:\n" in text, f"{name} has no section on its arguments"
    if "\nArgs:\n" in text:
        section = re.split(r"\n(?=\S)", text.split("\nArgs:\n")[1])[0]
        described = re.findall(r"^    (\w+):", section, re.M)
        assert described == parameters, f"{name} describes {described}, it takes {parameters}"
    if not method and inspect.signature(function).return_annotation is not None:
        assert "\nReturns:\n" in text, f"{name} does not say what it returns"
    if raises:
        assert "\nRaises:\n" in text, f"{name} raises and does not say what"


def test_the_public_functions_are_found() -> None:
    assert {"sysid.arx", "sysid.plots.bode", "sysid.IOData.detrend", "sysid.StateSpace.from_control"} <= set(PUBLIC)
