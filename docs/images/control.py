"""Take figures and record of two runs of `hmtb control` into the page and the package.

hmtb control --method following adaptive vrft --out build/control
hmtb control reach --duration 30 --with-stress --method following adaptive vrft --out build/stress
PYTHONPATH=. python docs/images/control.py build/control build/stress
"""

import json
import sys
from pathlib import Path

FOLDER = Path(__file__).parent
RECORD = FOLDER.parents[1] / "scenarios" / "data" / "control.json"
SHOWN = ("reach-run", "rpcm-run", "siso-5-elbow_pitch-run", "multisine-response", "errors")
LEFT_OUT = ("gains", "phases", "bandwidth_hz", "effort_without", "effort_with")


def main(runs: Path, stress: Path) -> None:
    """Copy the figures and write the record, without what the report does not show."""
    for folder, names in ((runs, SHOWN), (stress, ("stress",))):
        for name in names:
            (FOLDER / f"control-{name}.svg").write_bytes((folder / f"{name}.svg").read_bytes())
    record, other = (json.loads((folder / "control.json").read_text()) for folder in (runs, stress))
    record["stress"] = [{**row, "joints": {}} for row in (*other["runs"], *other["stress"])]
    for row in record["runs"]:
        for joint in row["joints"].values():
            for key in LEFT_OUT:
                del joint[key]
    RECORD.write_text(json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
