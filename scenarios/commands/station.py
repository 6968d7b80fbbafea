"""`hmtb station`: the operator's station in the browser."""

import sys
from pathlib import Path

from scenarios.commands.output import output_folder, say


def station(*, arm: str = "nominal", port: int = 0, out: Path = Path("."), browser: bool = True) -> int:
    """Operate the arm in the browser, from waveform to verdict.

    Serves the page until Ctrl-C, for this machine alone. The first browser steers, others watch. Needs the extra
    "station".

    Args:
        arm: The arm that is operated: a variant of the test bed, another arm by name, or the path of its files.
        port: Port on the loopback address; 0 takes a free one.
        out: Folder for the files that the page saves, and where it looks for files by name.
        browser: Open the page in the browser of this machine, where there is one.
    """
    import webbrowser

    from scenarios.station.server import load_viser

    load_viser()  # refuses before the arm is loaded, not after
    from scenarios.station.station import Station

    with output_folder(out) as folder:
        served = Station(folder, port, arm)
        try:
            say(f"station: {served.address} (Ctrl-C ends it)")
            sys.stdout.flush()
            if browser:
                webbrowser.open(served.address)
            served.wait()
        except KeyboardInterrupt:
            say("station: ended")
        finally:
            served.close()
    return 0
