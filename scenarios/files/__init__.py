"""Files and errors: records in every format, dataclasses as TOML and JSON, atomic writes, hashes, software versions."""

from scenarios.files.atomic_write import check_place, write_whole
from scenarios.files.errors import MissingRecordError, ScenarioError, unknown

__all__ = ["MissingRecordError", "ScenarioError", "check_place", "unknown", "write_whole"]
