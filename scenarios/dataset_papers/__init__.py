"""What is said of a data set: datasheet, licence, citation and the catalogues' metadata."""

__all__: list[str] = []
