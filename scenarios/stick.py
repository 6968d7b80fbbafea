"""Whether an excitation moves the stick by more than the hand-controller interface lets pass."""

import numpy as np

from scenarios.scenario import Scenario


def stays(scenario: Scenario) -> str | None:
    """Say that an excitation is too small to command anything, noise and bias of the wires apart.

    Args:
        scenario: The experiment.

    Returns:
        One line, or None where the stick moves, or an operator moves it.
    """
    if not scenario.excitation or scenario.has_own_operator:
        return None
    reach, interface = float(np.abs(scenario.volts()).max()), scenario.hand_controller
    if interface.deadband > 0.0 and reach <= interface.deadband:
        passes = f"within the deadband of {interface.deadband:g} V"
    elif scenario.chain.adc and reach <= interface.adc_step:
        passes = f"by no more than one count of {1e3 * interface.adc_step:.3g} mV"
    else:
        return None
    return f"the excitation moves the stick {passes}: no joint is commanded to move, but for noise and bias"
