"""What a page of charts holds besides its text: plotly.js, compressed, and the charts as JSON."""

import base64
import gzip
import json
from collections.abc import Mapping
from functools import cache

from scenarios.report.chart import Chart


@cache
def compressed_plotly() -> str:
    """Return plotly.js as base64 of gzip, two fifths of its size, which browsers unpack by themselves."""
    from plotly.offline import get_plotlyjs

    # Without a time in it: equal reports have equal bytes.
    return base64.b64encode(gzip.compress(get_plotlyjs().encode(), compresslevel=9, mtime=0)).decode("ascii")


def chart_script(charts: Mapping[str, Chart]) -> str:
    """Return charts by name as JSON inside a script element."""
    data = {name: chart.data() for name, chart in charts.items()}
    # Without NaN, which no browser reads in JSON: better an error here than an empty page.
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    # An end tag inside a string would end the script.
    return text.replace("</", "<\\/")
