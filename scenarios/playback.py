"""The log to look at: one from a file, or that of a scenario run now."""

from dataclasses import replace
from pathlib import Path

from hmtb_twin import JointLog, simulate
from scenarios.errors import ScenarioError
from scenarios.registry import load


def played(name: str, *, seed: int | None = None, duration: float | None = None) -> JointLog:
    """Return a log by name.

    Args:
        name: A file that ends in `.nc`, else a registered scenario or a TOML file, which is simulated.
        seed: Draws other noise, for a scenario.
        duration: Length instead of the scenario's own, s.

    Returns:
        The log.

    Raises:
        ScenarioError: There is no such scenario, a seed for a file, or the simulation failed.
        TwinError: The file is no joint log.
    """
    if name.endswith(".nc"):
        if seed is not None or duration is not None:
            raise ScenarioError(f"{name} is recorded: seed and duration belong to a scenario that is yet to run")
        return JointLog.load(Path(name))
    scenario = load(name)
    if duration is not None:
        scenario = replace(scenario, duration=duration)
    if seed is not None:
        scenario = scenario.reseeded(seed)
    result = simulate([scenario])
    for failed, why in result.failed.items():
        raise ScenarioError(f"{failed}: {why}")
    return result.logs[0]
