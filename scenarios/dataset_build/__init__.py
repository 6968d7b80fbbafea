"""A data set on its way to the disk: chunks, stages, manifest, resumption, one machine or many."""

__all__: list[str] = []
