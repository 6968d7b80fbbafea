"""Simulation of experiments side by side, from their descriptions to their logs, and replay of logs."""

from hmtb_twin.run.batch_run import BatchRun
from hmtb_twin.run.simulation import Logs, simulate

__all__ = ["BatchRun", "Logs", "simulate"]
