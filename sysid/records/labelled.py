"""Results with the names of their channels: as xarray data sets and pandas tables."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from sysid.records.optional import optional
from sysid.records.printing import Part, brief, tables

if TYPE_CHECKING:
    import pandas
    import xarray


class Labelled:
    """A record of arrays over named axes: samples, frequencies, lags, channels, parameters or candidates."""

    def to_xarray(self) -> "xarray.Dataset":
        """The arrays with their axes, names and units (attribute `units`)."""
        with optional("files"):
            import xarray

        variables, coordinates, attributes = self._variables()
        return xarray.Dataset(variables, coordinates, attributes)

    def to_dataframe(self) -> "pandas.DataFrame":
        """The same as a table, a row per sample, frequency and path, lag, parameter or candidate; `attrs` has units."""
        dataset = self.to_xarray()
        frame = dataset.to_dataframe()
        frame.attrs = {
            **dataset.attrs,
            "columns": {str(name): array.attrs for name, array in dataset.variables.items()},
        }
        return frame

    def _parts(self) -> list[Part]:
        variables, coordinates, attributes = self._shown()
        first = (type(self).__doc__ or "").partition("\n")[0]
        return [
            first,
            ", ".join(f"{name} {brief(value, 1)}" for name, value in attributes.items()),
            *tables(variables, coordinates),
        ]

    def _shown(self) -> tuple[Mapping[str, Any], Mapping[str, Any], Mapping[str, Any]]:
        """What is printed of them."""
        return self._variables()

    def _variables(self) -> tuple[Mapping[str, Any], Mapping[str, Any], Mapping[str, Any]]:
        """Arrays by name as (axes, values, attributes), coordinates of the axes likewise, attributes of the whole."""
        raise NotImplementedError
