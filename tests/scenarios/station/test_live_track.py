"""The thread that follows a live run; its estimates are in the tests of the experiment tab."""

from types import SimpleNamespace

from scenarios.station.live_track import LiveTrack


def test_a_run_shorter_than_the_calibration_ends_the_thread():
    said = []
    track = LiveTrack(None, SimpleNamespace(say=lambda text, **_: said.append(text)))
    for _ in range(3):
        track.add(0.0, 0.0)
    track.close()
    track._thread.join(timeout=20.0)
    assert not track._thread.is_alive()
    assert said == ["the bandwidth follows after 30 s of calibration"]
