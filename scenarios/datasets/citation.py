"""How a data set is cited: for readers (CFF) and for registries of DOIs (DataCite)."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from scenarios.datasets.license import NAME, SPDX, URL
from scenarios.datasets.spec import DataSetSpec

THESIS = "Comparison of System Identification Techniques for the Hydraulic Manipulator Test Bed (HMTB)"
"""The report whose experiments the laboratory follows [Morris1996]."""

SOFTWARE = "HMTB twin"
"""What data sets are made with."""

METHODS = (
    "Simulated with a MuJoCo model of a seven-joint hydraulic arm, its servos, hand controller and 1553 record at "
    "50 Hz. Built from a spec; every draw of chance comes from one seed."
)
"""How the data came about."""


def citation_cff(spec: DataSetSpec, whole: str) -> str:
    """The citation file, CFF 1.2.0; JSON texts are YAML texts.

    Args:
        spec: The data set.
        whole: Hash of its arrays.
    """
    said = {
        "cff-version": "1.2.0",
        "message": "If you use these data, please cite them, and the thesis whose experiments they follow.",
        "type": "dataset",
        "title": spec.title,
        **({"abstract": spec.description} if spec.description else {}),
        "version": str(spec.version),
        "license": SPDX,
        **({"date-released": spec.date} if spec.date else {}),
        **({"url": spec.url} if spec.url else {}),
        "authors": [_cff_author(name) for name in spec.creators],
        "keywords": list(dict.fromkeys(spec.keywords)),
        "identifiers": [
            {"type": "other", "value": f"sha256:{whole}", "description": f"Hash of all arrays of {spec.label}"}
        ],
        "references": [
            {
                "type": "report",
                "title": THESIS,
                "authors": [{"family-names": "Morris", "given-names": "A. T."}],
                "institution": {"name": "NASA Langley Research Center"},
                "number": "NASA TM-110279",
                "year": 1996,
            },
            {"type": "software", "title": SOFTWARE, "authors": [{"name": "The HMTB twin contributors"}]},
        ],
    }
    # A day without quotes is a date to a reader of YAML, not the text that the format asks for; JSON always quotes.
    return "".join(f"{key}: {json.dumps(value, ensure_ascii=False)}\n" for key, value in said.items() if value)


def datacite(spec: DataSetSpec, whole: str, sizes: Sequence[str], formats: Sequence[str]) -> Mapping[str, Any]:
    """The record for a registry of DOIs, DataCite 4.5; a year of publication is in it where the spec has a date.

    Args:
        spec: The data set.
        whole: Hash of its arrays.
        sizes: How large it is, in words.
        formats: Media types of its files.
    """
    day = {
        "publicationYear": spec.date[:4],
        "dates": [{"date": spec.date, "dateType": "Issued"}],
    }
    return {
        "schemaVersion": "http://datacite.org/schema/kernel-4",
        "types": {"resourceTypeGeneral": "Dataset", "resourceType": "Simulated records for system identification"},
        "titles": [{"title": spec.title, "lang": "en"}],
        "creators": [_datacite_creator(name) for name in spec.creators],
        "publisher": {"name": "The HMTB twin contributors"},
        **({"url": spec.url} if spec.url else {}),
        **(day if spec.date else {}),
        "subjects": [{"subject": word} for word in dict.fromkeys(spec.keywords)],
        "language": "en",
        "alternateIdentifiers": [
            {"alternateIdentifier": spec.label, "alternateIdentifierType": "name with version"},
            {"alternateIdentifier": whole, "alternateIdentifierType": "SHA-256 of all arrays"},
        ],
        "sizes": list(sizes),
        "formats": list(formats),
        "version": str(spec.version),
        "rightsList": [
            {
                "rights": NAME,
                "rightsUri": URL,
                "rightsIdentifier": SPDX,
                "rightsIdentifierScheme": "SPDX",
                "schemeUri": "https://spdx.org/licenses/",
            }
        ],
        "descriptions": [
            {"description": spec.description or spec.title, "descriptionType": "Abstract", "lang": "en"},
            {"description": METHODS, "descriptionType": "Methods", "lang": "en"},
        ],
        "relatedItems": [
            {
                "relationType": "IsDerivedFrom",
                "relatedItemType": "Report",
                "titles": [{"title": THESIS}],
                "creators": [{"name": "Morris, A. T.", "nameType": "Personal"}],
                "publicationYear": "1996",
                "publisher": "NASA Langley Research Center",
                "number": "NASA TM-110279",
                "numberType": "Report",
            },
        ],
    }


def reference(spec: DataSetSpec) -> str:
    """The data set in one line of a bibliography."""
    year = f" ({spec.date[:4]})" if spec.date else ""
    where = f" {spec.url}" if spec.url else ""
    return f"{'; '.join(spec.creators)}{year}: {spec.title}. Data set {spec.name}, version {spec.version}.{where}"


def bibtex(spec: DataSetSpec, whole: str) -> str:
    """The data set for BibTeX.

    Args:
        spec: The data set.
        whole: Hash of its arrays.
    """
    fields = {
        "title": f"{{{spec.title}}}",
        "author": " and ".join(f"{{{name}}}" if ", " not in name else name for name in spec.creators),
        **({"year": spec.date[:4]} if spec.date else {}),
        "version": str(spec.version),
        **({"url": spec.url} if spec.url else {}),
        "note": f"SHA-256 of all arrays {whole}",
    }
    return f"@misc{{{spec.label},\n" + "".join(f"  {key} = {{{value}}},\n" for key, value in fields.items()) + "}\n"


def _person(name: str) -> tuple[str, str] | None:
    """Family and given names of somebody who is written ``"Family, Given"``; None for a group."""
    family, comma, given = name.partition(", ")
    return (family, given) if comma and given else None


def _cff_author(name: str) -> dict[str, str]:
    person = _person(name)
    return {"family-names": person[0], "given-names": person[1]} if person else {"name": name}


def _datacite_creator(name: str) -> dict[str, str]:
    person = _person(name)
    if person is None:
        return {"name": name, "nameType": "Organizational"}
    return {"name": name, "nameType": "Personal", "familyName": person[0], "givenName": person[1]}
