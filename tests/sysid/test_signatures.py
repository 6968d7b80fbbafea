"""Public functions of `sysid`: signatures that `help` can show."""

import inspect

import pytest

import sysid

PUBLIC = [name for name in sysid.__all__ if callable(getattr(sysid, name)) and not name.endswith(("Error", "Warning"))]


@pytest.mark.parametrize("name", PUBLIC)
def test_signature_names_every_argument(name):
    kinds = {parameter.kind for parameter in inspect.signature(getattr(sysid, name)).parameters.values()}
    assert not kinds & {inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD}
