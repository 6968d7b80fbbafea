"""The thesis, finding by finding: its campaign, its analyses, its findings and the report [Morris1996]."""

__all__: list[str] = []
