"""The 1553 bus and its recorder: joint logs, bus records, and Chapter 10 files with the faults of a bus."""

from hmtb_twin.bus.joint_log import JointLog
from hmtb_twin.bus.messages import BusFaults
from hmtb_twin.bus.record import BusRecord
from hmtb_twin.bus.recorder_run import BusRun, read_run, record_run

__all__ = ["BusFaults", "BusRecord", "BusRun", "JointLog", "read_run", "record_run"]
