"""The public names exist and the package needs nothing of the laboratory."""

import sysid


def test_every_public_name_is_there() -> None:
    assert sorted(sysid.__all__) == sorted(set(sysid.__all__))
    for name in sysid.__all__:
        assert getattr(sysid, name).__doc__, name
