"""A station whose panels are built without a browser: they are put on the page that all browsers would share."""

import time
from types import SimpleNamespace

import pytest

pytest.importorskip("viser")

from scenarios.station.station import Station


@pytest.fixture(scope="session")
def served(tmp_path_factory):
    station = Station(tmp_path_factory.mktemp("station"))
    yield station
    station.close()


@pytest.fixture
def page(served):
    """The station and a stand-in for the browser that steers, which keeps notices and downloads."""
    notices, downloads = [], {}
    client = SimpleNamespace(
        client_id=0,
        gui=served.server.gui,
        camera=SimpleNamespace(),
        notices=notices,
        downloads=downloads,
        add_notification=lambda title, body, **_: notices.append(f"{title}: {body}"),
        send_file_download=lambda name, content, **_: downloads.update({name: content}),
    )
    yield served, client
    served.motion.stop()
    wait_until(lambda: not served.work.label)
    served.session.forget_watchers()
    served.session.records.clear()
    served.session.memory.clear()
    served.server.gui.reset()


def press(button):
    """Press a button and wait until its handlers have ended."""
    for handler in button._impl.update_cb:
        handler(SimpleNamespace(client=None, target=button))


def wait_until(condition, seconds=60.0):
    """Wait for a condition, which long work or a thread makes true."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "still not so"
        time.sleep(0.02)


def at_once(label, function, *arguments, done, failed):
    """Call the function here, as a stand-in for `Work.start`, which calls it in a child process."""
    try:
        result = function(*arguments)
    except ValueError as error:
        failed(f"{label}: {error}")
    else:
        done(result)
