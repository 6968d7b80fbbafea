"""Tasks: what an operator does in place of the excitation computer."""

from collections.abc import Callable

from hmtb_twin import HandController, JointLog, Operator
from hmtb_twin.modes import TOOL_AXES, axis_gains
from scenarios.errors import ScenarioError
from scenarios.operator import ScriptedOperator, Step
from scenarios.rpcm import rpcm_script, unloaded_script
from scenarios.rpcm_outcome import RpcmOutcome, rpcm_outcome
from scenarios.suggest import unknown

TASKS: dict[str, Callable[[], tuple[Step, ...]]] = {"rpcm": rpcm_script, "rpcm-unloaded": unloaded_script}
"""The script of each task."""

MODE = "cartesian_rate"
"""The mode in which the operator works."""


def judged(log: JointLog, task: str) -> RpcmOutcome | None:
    """Return what became of the unit where a task was to insert it."""
    return rpcm_outcome(log) if task == "rpcm" else None


def check_task(task: str, *, mode: str, axes: tuple[str, ...], worksite: bool, payload: str, excited: bool) -> None:
    """Raise unless a scenario gives its operator what the task needs.

    Args:
        task: The task.
        mode: Control mode.
        axes: Axes of the stick.
        worksite: Whether the arm is at the worksite.
        payload: What the end effector holds at first.
        excited: Whether the excitation computer is to play something.

    Raises:
        ScenarioError: Unknown task, or something else than what it needs.
    """
    if task not in TASKS:
        raise ScenarioError(unknown("task", task, TASKS))
    wrong = [
        text
        for fails, text in (
            (mode != MODE, f'mode = "{MODE}"'),
            (axes != TOOL_AXES, f"axes = {', '.join(TOOL_AXES)}"),
            (not worksite, "worksite = true"),
            (payload != "none", 'payload = "none", the unit in its holster'),
            (excited, "no excitation"),
        )
        if fails
    ]
    if wrong:
        raise ScenarioError(f"task {task!r} expects {'; '.join(wrong)}")


def task_operator(task: str, seed: int, hand_controller: HandController) -> Operator:
    """Return an operator for a task.

    Args:
        task: One of `TASKS`.
        seed: Of what the operator misses and misjudges.
        hand_controller: The interface whose gains the operator is used to.
    """
    return ScriptedOperator(TASKS[task](), axis_gains(MODE, TOOL_AXES, hand_controller), seed)
