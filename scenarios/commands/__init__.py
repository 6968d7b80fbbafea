"""The commands of `hmtb`, a file each; what is heavy is imported when a command runs."""

__all__: list[str] = []
