"""Without an optional package, what needs it says which one to install."""

import pydoc
import sys

import numpy as np
import pytest

import sysid
from tests.refusals import refused

U = np.random.default_rng(0).standard_normal(50)
DATA = sysid.IOData(U, np.cumsum(U), 0.1)


@pytest.mark.parametrize(
    ("package", "extra", "call"),
    [
        ("control", "control", lambda path: sysid.arx(DATA, 1, 1).model.to_control()),
        ("xarray", "files", lambda path: DATA.to_xarray()),
        ("pandas", "files", lambda path: sysid.read_csv(path)),
        ("matplotlib", "plots", lambda path: sysid.plots.bode(sysid.arx(DATA, 1, 1))),
    ],
)
def test_a_missing_package_is_named_with_its_extra(package, extra, call, monkeypatch, tmp_path):
    path = tmp_path / "record.csv"
    path.write_text("t,u,y\n0.0,1.0,0.5\n0.1,1.0,0.6\n")
    # An import of a module that stands for None fails as if it were not installed.
    monkeypatch.setitem(sys.modules, package, None)
    for name in list(sys.modules):
        if name.startswith(f"{package}."):
            monkeypatch.setitem(sys.modules, name, None)
        # The figures have been loaded by other tests: here they are loaded again.
        elif name.startswith("sysid.plots"):
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.delattr(sysid, "plots", raising=False)
    refused(rf"this needs the package {package}: pip install './sysid\[{extra}\]'", call, path)
    if extra == "plots":
        # Help asks for every name of the package.
        assert not hasattr(sysid, "plots")
        assert "Estimate" in pydoc.render_doc(sysid)
