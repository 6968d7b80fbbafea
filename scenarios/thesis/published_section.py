"""Report section on published values: those the twin assumes and those it reproduces."""

import tomllib
from collections.abc import Iterable, Sequence
from importlib.resources import files
from math import degrees
from typing import NamedTuple

from hmtb_twin import STUDIED_JOINTS
from hmtb_twin.parameters.drives import ACTUATORS
from hmtb_twin.parameters.values import BUS, GAINS, HAND_CONTROLLER, MOTIONS, SERVOS
from scenarios.experiments.campaign import RPCM
from scenarios.experiments.registry import names as tests
from scenarios.files.errors import MissingRecordError
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.estimates import Fits, fits
from scenarios.thesis.finding import Finding
from scenarios.truth.published import DRAWS, EQUATIONS, PUBLISHED, SYSTEMS, PublishedModel, published
from sysid import IOData


class AssumedValue(NamedTuple):
    """A value of the twin that comes from the thesis, its origin with what follows, and the findings it affects."""

    what: str
    why: str
    findings: tuple[str, ...]


def assumed_values() -> tuple[AssumedValue, ...]:
    """Return every value of the nominal arm that comes from the thesis."""
    frictions = [ACTUATORS[name].coulomb_torque / ACTUATORS[name].rated_torque for name in STUDIED_JOINTS]
    numbers = {
        "slow": _span(SERVOS[name].slow_pole for name in STUDIED_JOINTS),
        "printed": sum(len(published(name)) for name in STUDIED_JOINTS),
        "delays": _span(BUS[name].delay for name in STUDIED_JOINTS),
        "friction": _span(100 * friction for friction in frictions),
        "gain": HAND_CONTROLLER.gain,
        "limits": _span(degrees(MOTIONS[name].velocity_limit) for name in STUDIED_JOINTS),
        "readings": _span(GAINS.values()),
    }
    table = tomllib.loads((files("scenarios") / "data" / "assumed_values.toml").read_text(encoding="utf-8"))
    return tuple(
        AssumedValue(row["what"].format(**numbers), row["why"].format(**numbers), tuple(row["findings"]))
        for row in table["value"]
    )


def assumed_values_of(findings: Sequence[Finding]) -> dict[str, tuple[AssumedValue, ...]]:
    """Return the assumed values that affect each finding; findings without one are left out."""
    known = assumed_values()
    values = {entry.key: tuple(part for part in known if entry.key in part.findings) for entry in findings}
    return {key: parts for key, parts in values.items() if parts}


def _span(values: Iterable[float]) -> str:
    """The value as text, or the ends of the range, smallest magnitude first."""
    texts = [f"{value:g}".replace("-", "−") for value in sorted(set(values), key=abs)]
    return texts[0] if len(texts) == 1 else f"{texts[0]} to {texts[-1]}"


class PrintedRow(NamedTuple):
    """A printed model with its fits: to single-joint tests by number, on its joint to records of several by name."""

    printed: PublishedModel
    singles: dict[int, Fits]
    several: dict[str, Fits]


def published_section(study: Comparison) -> dict[str, object]:
    """Variables of the template of this section."""
    records = several_records(study)
    rows = [printed_row(study, entry, records) for entry in (*PUBLISHED, EQUATIONS["4.7+4.9"])]
    rows.sort(key=lambda row: (STUDIED_JOINTS.index(row.printed.joint), row.printed.method))
    return {"rows": rows, "records": list(records), "draws": DRAWS, "systems": SYSTEMS}


def printed_row(study: Comparison, printed: PublishedModel, records: dict[str, IOData]) -> PrintedRow:
    """Row of a printed model, with its fits to the single-joint tests and to records of several joints."""
    singles = study.joints[printed.joint].data
    k = STUDIED_JOINTS.index(printed.joint)
    return PrintedRow(
        printed,
        {number: fits(printed.model, data) for number, data in singles.items()},
        {name: fits(printed.model, data.select(inputs=[k], outputs=[k])) for name, data in records.items()},
    )


def several_records(study: Comparison, names: Sequence[str] | None = None) -> dict[str, IOData]:
    """Records of the studied joints together, those that there are: table 2, then the exchange."""
    records: dict[str, IOData] = {}
    for name in names or (*tests("table2"), RPCM):
        try:
            records[name] = study.campaign.several(name)
        except MissingRecordError:
            continue
    return records
