"""What an estimator on the test bench is given and gives back, and the process of its own in which it runs."""

__all__: list[str] = []
