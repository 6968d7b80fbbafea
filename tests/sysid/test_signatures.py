"""Public functions of `sysid`: signatures that `help` can show."""

import inspect

import sysid
import sysid.plots


def test_signatures_name_every_argument():
    functions = {
        name: value
        for package in (sysid, sysid.plots)
        for name in package.__all__
        if inspect.isfunction(value := getattr(package, name))
    }
    assert {"oe", "bode"} <= functions.keys()
    for name, function in functions.items():
        kinds = {parameter.kind for parameter in inspect.signature(function).parameters.values()}
        assert not kinds & {inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD}, name
