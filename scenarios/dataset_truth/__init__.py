"""What is true of a data set: its arms, their best linear approximations, the least error attainable."""

__all__: list[str] = []
