"""Report section on published values: those the twin assumes and those it reproduces."""

import tomllib
from collections.abc import Iterable
from importlib.resources import files
from math import degrees
from typing import NamedTuple

from hmtb_twin import STUDIED_JOINTS
from hmtb_twin.parameters.drives import ACTUATORS
from hmtb_twin.parameters.values import BUS, GAINS, HAND_CONTROLLER, MOTIONS, SERVOS
from scenarios.experiments.campaign import RPCM
from scenarios.experiments.registry import names as tests
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.estimates import Fits, fits
from scenarios.truth.published import DRAWS, EQUATIONS, PUBLISHED, SYSTEMS, PublishedModel, published


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
    records = [name for name in (*tests("table2"), RPCM) if name in study.logs]
    rows = [printed_row(study, printed, records) for printed in (*PUBLISHED, EQUATIONS["4.7+4.9"])]
    rows.sort(key=lambda row: (STUDIED_JOINTS.index(row.printed.joint), row.printed.method))
    return {"rows": rows, "records": records, "draws": DRAWS, "systems": SYSTEMS}


def printed_row(study: Comparison, printed: PublishedModel, records: Iterable[str]) -> PrintedRow:
    """Row of a printed model, with its fits to the single-joint tests and to records of several joints."""
    model, joint = printed.model, printed.joint
    return PrintedRow(
        printed,
        {number: fits(model, data) for number, data in study.joints[joint].data.items()},
        {name: fits(model, study.campaign.record(name, joint)) for name in records},
    )
