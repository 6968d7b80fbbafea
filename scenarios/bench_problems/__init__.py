"""Systems whose truth is known, and the records that estimators on the test bench are given."""

__all__: list[str] = []
