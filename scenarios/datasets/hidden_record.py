"""What of a record is published where the truth is hidden.

Of a scored record the commands are given whole and everything that was measured for the initialisation window alone.
The angles of other joints, force and torque, and the flags are withheld with the outputs: what the wrist feels
and the coupling between the joints show how the arm really moved, to whoever cannot foretell it from the commands.
"""

import numpy as np

from scenarios.datasets.netcdf import Contents, Variable
from scenarios.datasets.plan import Entry
from scenarios.datasets.spec import DataSetSpec

GIVEN = ("sample", "u", "joint_commanded")
"""Variables of a scored record that are given for all samples."""

WINDOW = "window_sample"
"""Along it stands what is given for the initialisation window."""

PRIVATE = ("seed", "process_noise")
"""What the index of a data set says of an experiment, and that of a published one does not: it is drawn."""


def published(contents: Contents, entry: Entry, spec: DataSetSpec) -> Contents:
    """A record without what tells how to run it again, and a scored one without its outputs.

    Args:
        contents: The whole record.
        entry: The experiment.
        spec: The data set.
    """
    attributes = {
        key: value for key, value in contents.attributes.items() if key != "seed" and not key.startswith("provenance_")
    }
    if entry.part != "test":
        return Contents(contents.variables, attributes)
    window = min(spec.window, len(contents.variables["u"].values))
    index = {**contents.variables["sample"].attributes, "long_name": "sample number within the initialisation window"}
    variables: dict[str, Variable] = {}
    for name, variable in contents.variables.items():
        if variable.dims[:1] != ("sample",) or name in GIVEN:
            variables[name] = variable
            continue
        cut = np.ascontiguousarray(variable.values[:window])
        variables[name] = Variable((WINDOW, *variable.dims[1:]), cut, variable.attributes)
    variables[WINDOW] = Variable((WINDOW,), np.arange(window, dtype=np.int64), index)
    return Contents(variables, {**attributes, "withheld": f"what was measured from sample {window} on"})
