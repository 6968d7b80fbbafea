"""Arms from files: MJCF and URDF, read into descriptions, with rules for what the files leave out."""

from hmtb_twin.arm_files.known_arms import arm_named

__all__ = ["arm_named"]
