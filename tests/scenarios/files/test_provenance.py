"""A result says with which version it was made, installed or not."""

import re
from importlib.metadata import PackageNotFoundError

from scenarios.files import provenance


def test_the_version_of_the_source_stands_for_a_package_that_is_not_installed(monkeypatch):
    def missing(name: str) -> str:
        raise PackageNotFoundError(name)

    monkeypatch.setattr(provenance, "_installed", missing)
    versions = provenance.versions()
    assert re.fullmatch(r"\d+\.\d+\S* from source", versions["hmtb-twin"])
    assert versions["mujoco"] == "not installed as a package"
