"""A model as a Functional Mock-up Unit: co-simulation by FMI 2.0, in C."""

import io
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import uuid
import warnings
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from xml.etree import ElementTree

from sysid.exchange.c_source import c_files, c_values, filled
from sysid.exchange.files import heading, named_path, operating_point, software, write_whole
from sysid.models.estimate import Estimate
from sysid.models.model_forms import as_model
from sysid.models.state_space import StateSpace
from sysid.records.arguments import optional_text, shown
from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError, SysidWarning

FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden")


def to_fmu(model: StateSpace | Estimate, path: str | Path, *, compiler: str | None = "cc") -> Path:
    """Write the path from u to y as a Functional Mock-up Unit for co-simulation [FMI2014].

    Inputs, outputs and states are its variables, with names and units; the operating point that the estimate knows is
    a set of parameters. A communication step is a multiple of the sampling interval. Inputs hold during a step; outputs
    follow the inputs that are set, so that a direct term acts at once. The unit contains its sources and, on 64-bit
    Linux with a C compiler, a binary; elsewhere the importing tool compiles it. Equal models make equal files.

    Args:
        model: A model or estimate.
        path: Where to write, servo.fmu; the name is that of the unit.
        compiler: C compiler; None leaves the binary out.

    Returns:
        The file.

    Raises:
        SysidError: A name that is no identifier, channels whose names are empty, twice or not printable, a compiler
            that fails.

    Warns:
        SysidWarning: No such compiler, or another system than 64-bit Linux: the file has no binary.
    """
    file = named_path(path, ".fmu")
    compiler = optional_text("compiler", compiler)
    sources = c_files(model, file.stem)
    # the same identity for the same model, so that the file is the same
    guid = str(uuid.uuid5(uuid.NAMESPACE_OID, "".join(map(repr, sources.values()))))
    values = {**c_values(model, file.stem), "guid": guid}
    sources[f"{file.stem}_fmi2.c"] = filled("fmi2.c", values)
    contents = {"modelDescription.xml": _description(model, file.stem, guid, sources)}
    contents |= {f"sources/{name}": source for name, source in sources.items()}
    if compiler is not None and (binary := _compiled(sources, compiler)) is not None:
        contents[f"binaries/linux64/{file.stem}.so"] = binary
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in contents.items():
            archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)
    write_whole(file, buffer.getvalue())
    return file


def _compiled(sources: Mapping[str, bytes], compiler: str) -> bytes | None:
    program = shutil.which(compiler)
    if program is None or sys.platform != "linux" or platform.machine() != "x86_64":
        reason = f"no C compiler {compiler!r}" if program is None else f"{sys.platform} {platform.machine()}"
        message = f"{reason}: the FMU holds C source and no binary; its importer compiles it"
        warnings.warn(message, SysidWarning, stacklevel=3)
        return None
    with tempfile.TemporaryDirectory() as folder:
        for name, content in sources.items():
            Path(folder, name).write_bytes(content)
        files = [name for name in sources if name.endswith(".c")]
        # Where PATH is not set `which` looks in the default folders; the compiler must find its linker there too.
        environment = {"PATH": os.defpath, **os.environ}
        words = [program, *FLAGS, "-o", "unit.so", *files, "-lm"]
        done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True)
        if done.returncode:
            raise SysidError(f"{compiler} failed: {done.stderr.strip()}; compiler=None leaves the binary out")
        return Path(folder, "unit.so").read_bytes()


def _description(model: StateSpace | Estimate, name: str, guid: str, sources: Mapping[str, bytes]) -> bytes:
    """Text of modelDescription.xml."""
    m, dt = as_model(model).input_path(), repr(as_model(model).dt)
    root = ElementTree.Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=name,
        guid=guid,
        description=heading(model),
        generationTool=software(),
        variableNamingConvention="flat",
    )
    simulation = ElementTree.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=name,
        canHandleVariableCommunicationStepSize="false",
        canNotUseMemoryManagementFunctions="true",
    )
    listed = ElementTree.SubElement(simulation, "SourceFiles")
    for file in sources:
        if file.endswith(".c"):
            ElementTree.SubElement(listed, "File", name=file)
    variables = list(_variables(m, operating_point(model)))
    names = [attributes["name"] for attributes, _ in variables]
    for name in names:
        if not name.isprintable() or name != name.strip() or not name or names.count(name) > 1:
            raise SysidError(
                f"the channel name {shown(name)} is empty, not printable or not unique; expected a name of its own for "
                "every input and output: dataclasses.replace(model, input_names=..., output_names=...)"
            )
    units = ElementTree.SubElement(root, "UnitDefinitions")
    for unit in dict.fromkeys(real["unit"] for _, real in variables if "unit" in real):
        ElementTree.SubElement(units, "Unit", name=unit)
    if not len(units):
        root.remove(units)
    ElementTree.SubElement(root, "DefaultExperiment", startTime="0", stepSize=dt)
    declared = ElementTree.SubElement(root, "ModelVariables")
    for reference, (attributes, real) in enumerate(variables):
        variable = ElementTree.SubElement(declared, "ScalarVariable", attributes, valueReference=str(reference))
        ElementTree.SubElement(variable, "Real", real)
    structure = ElementTree.SubElement(root, "ModelStructure")
    for element in ("Outputs", "InitialUnknowns"):
        unknowns = ElementTree.SubElement(structure, element)
        for k in range(m.ny):
            ElementTree.SubElement(unknowns, "Unknown", index=str(m.nu + k + 1))
    ElementTree.indent(root)
    return bytes(ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)) + b"\n"


def _variables(m: StateSpace, point: tuple[FloatArray, FloatArray]) -> Iterator[tuple[dict[str, str], dict[str, str]]]:
    """Attributes of every variable and of its `Real`, in the sequence of the value references of fmi2.c."""
    inputs = list(zip(m.input_names or (), m.input_units or (), point[0], strict=True))
    outputs = list(zip(m.output_names or (), m.output_units or (), point[1], strict=True))
    for name, unit, level in inputs:
        yield {"name": name, "causality": "input", "variability": "discrete"}, _real(unit, level)
    for name, unit, _ in outputs:
        yield {"name": name, "causality": "output", "variability": "discrete"}, _real(unit)
    for name, unit, level in (*inputs, *outputs):
        point_of = {"name": f"operating point of {name}", "causality": "parameter", "variability": "tunable"}
        yield point_of, _real(unit, level)
    for k in range(m.order):
        state = {"name": f"state[{k + 1}]", "causality": "local", "variability": "discrete", "initial": "exact"}
        yield state, _real("", 0.0)


def _real(unit: str, start: float | None = None) -> dict[str, str]:
    attributes = {}
    if unit:
        attributes["unit"] = unit
    if start is not None:
        attributes["start"] = repr(float(start))
    return attributes
