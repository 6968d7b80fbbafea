"""Files and errors: records in every format, dataclasses as TOML and JSON, software versions."""

from scenarios.files.errors import MissingRecordError, ScenarioError, unknown

__all__ = ["MissingRecordError", "ScenarioError", "unknown"]
