"""Records as Parquet files."""

import io
import json

import numpy as np

from scenarios.datasets.columns import columns
from scenarios.datasets.netcdf import Contents
from scenarios.errors import ScenarioError


def parquet(contents: Contents) -> bytes:
    """Write a record as Parquet: a column per channel; units stand in the metadata of the columns.

    Args:
        contents: What the file of the record holds.

    Raises:
        ScenarioError: pyarrow is not installed.
    """
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError as error:
        raise ScenarioError("Parquet needs pyarrow: pip install 'hmtb-twin[parquet]'") from error
    table = columns(contents)
    fields = [
        pa.field(
            column.name,
            pa.from_numpy_dtype(column.values.dtype),
            nullable=False,
            metadata={"unit": column.unit, "role": column.role, "description": column.meaning},
        )
        for column in table
    ]
    about = {
        key: value if isinstance(value, str) else json.dumps(value, default=np.ndarray.tolist)
        for key, value in contents.attributes.items()
    }
    made = pa.Table.from_arrays([pa.array(column.values) for column in table], schema=pa.schema(fields, about))
    target = io.BytesIO()
    pq.write_table(made, target)
    return target.getvalue()
