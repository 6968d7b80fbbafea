"""What a method does not do: said before anything is computed, and not counted against it."""

from scenarios.estimators.task import Task
from sysid import IOData


def only_structure(task: Task, structure: str) -> None:
    """Refuse every other structure.

    Raises:
        NotImplementedError: Another one is asked for.
    """
    if task.structure != structure:
        raise NotImplementedError(f"structure {task.structure!r} asked for, this method has {structure!r}")


def only_given_orders(task: Task, why: str) -> None:
    """Refuse to choose orders.

    Args:
        task: What was asked.
        why: What the method has instead.

    Raises:
        NotImplementedError: The task leaves them open.
    """
    if task.chooses:
        raise NotImplementedError(f"no choice of orders: {why}")


def only_one_output(data: IOData) -> None:
    """Refuse several outputs.

    Raises:
        NotImplementedError: There are several.
    """
    if data.ny > 1:
        raise NotImplementedError(f"{data.ny} outputs given, this method takes one")


def only_one_channel(data: IOData) -> None:
    """Refuse several inputs or outputs.

    Raises:
        NotImplementedError: There are several of either.
    """
    if data.nu > 1 or data.ny > 1:
        raise NotImplementedError(f"{data.nu} inputs and {data.ny} outputs given, this method takes one of each")


def only_delayed(task: Task) -> None:
    """Refuse a direct term.

    Raises:
        NotImplementedError: The output depends on the input of the same sample.
    """
    if task.orders.get("nk", 1) < 1:
        raise NotImplementedError("nk = 0 asked for, this method has a delay of one sample at least")
