"""The data set as machine learning catalogues read it: Croissant 1.0.

The format knows no NetCDF. Records are file objects with their hashes, or sets of files where there are many; what
can be read through it row by row is the table of experiments.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from scenarios.datasets.citation import METHODS, bibtex
from scenarios.datasets.experiment_table import COLUMNS
from scenarios.datasets.license import URL
from scenarios.datasets.listing import NETCDF, Listed
from scenarios.datasets.spec import DataSetSpec

TABLE = "experiments"
"""Name of the record set."""

TYPES = {"string": "sc:Text", "integer": "sc:Integer", "number": "sc:Float"}
"""Types of its fields, by the kind of the column."""

_TERMS = (
    "citeAs column conformsTo equivalentProperty extract field fileProperty fileObject fileSet format includes "
    "isLiveDataset jsonPath key md5 parentField path recordSet references regex repeated replace samplingRate "
    "separator source subField transform"
)

CONTEXT: Mapping[str, Any] = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "sc": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "dct": "http://purl.org/dc/terms/",
    **{term: f"cr:{term}" for term in _TERMS.split()},
    "conformsTo": "dct:conformsTo",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "examples": {"@id": "cr:examples", "@type": "@json"},
}
"""What its words mean, as the format prescribes."""


def croissant(
    spec: DataSetSpec, whole: str, table: Listed, files: Sequence[Listed], sets: Mapping[str, str]
) -> Mapping[str, Any]:
    """The description.

    Args:
        spec: The data set.
        whole: Hash of its arrays.
        table: The table of experiments, CSV.
        files: Every other file that is listed by itself.
        sets: Patterns of the records that are not, by the name of the set.
    """
    return {
        "@context": CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": spec.label,
        "alternateName": spec.title,
        "description": spec.description or spec.title,
        "version": f"{spec.version}.0.0",
        "license": URL,
        **({"datePublished": spec.date} if spec.date else {}),
        **({"url": spec.url} if spec.url else {}),
        "creator": [{"@type": "sc:Organization", "name": name} for name in spec.creators],
        "keywords": list(spec.keywords),
        "citeAs": bibtex(spec, whole),
        "isLiveDataset": False,
        "rai:dataCollection": METHODS,
        "rai:dataLimitations": "A simulation: parameters that no document of the machine gives are assumed.",
        "rai:personalSensitiveInformation": "None.",
        "distribution": [
            *(_file_object(one) for one in (table, *files)),
            *(
                {
                    "@type": "cr:FileSet",
                    "@id": name,
                    "name": name,
                    "encodingFormat": NETCDF,
                    "includes": pattern,
                }
                for name, pattern in sets.items()
            ),
        ],
        "recordSet": [
            {
                "@type": "cr:RecordSet",
                "@id": TABLE,
                "name": TABLE,
                "description": "One row per experiment; each record is a NetCDF4 file.",
                "key": {"@id": f"{TABLE}/name"},
                "field": [
                    {
                        "@type": "cr:Field",
                        "@id": f"{TABLE}/{column.name}",
                        "name": f"{TABLE}/{column.name}",
                        "description": column.description,
                        "dataType": TYPES[column.kind],
                        "source": {"fileObject": {"@id": table.path}, "extract": {"column": column.name}},
                    }
                    for column in COLUMNS
                ],
            }
        ],
    }


def _file_object(one: Listed) -> Mapping[str, Any]:
    return {
        "@type": "cr:FileObject",
        "@id": one.path,
        "name": one.path,
        "contentUrl": one.path,
        "contentSize": f"{one.size} B",
        "encodingFormat": one.media,
        "sha256": one.sha256,
    }
