"""Motion of the arm on the page: one live run or one replay at a time, in a thread of its own."""

import threading
from collections import deque
from collections.abc import Callable, Iterator
from time import perf_counter, sleep

from hmtb_twin.bus.joint_log import JointLog
from hmtb_twin.control.experiment import Experiment
from hmtb_twin.files.errors import TwinError
from hmtb_twin.run.live_run import Frame, LiveRun, frame_of

FRAME_RATE = 30.0
"""Pictures per second that the browsers get, Hz."""

Watch = Callable[[list[Frame]], None]
"""Called for every picture with the frames since the last one."""

Done = Callable[[JointLog | None, str | None], None]
"""Called at the end with the log of a run, as far as it went, and why it failed; None where there is none."""


class Playback:
    """Speed, position and repetition of a replay, which may change while it runs.

    Args:
        log: The log to replay.
        first: Time at which the replay begins, s.
        speed: Seconds of the log per second.
        loop: Whether to begin again at the end.

    Attributes:
        log, speed, loop: As above; speed and loop may change at any time.
    """

    def __init__(self, log: JointLog, first: float = 0.0, *, speed: float = 1.0, loop: bool = False) -> None:
        self.log, self.speed, self.loop = log, speed, loop
        # Appending to and popping from a deque is atomic: the page seeks while the thread of the replay reads.
        self._sought: deque[int] = deque(maxlen=1)
        self.seek(first)

    def seek(self, time: float) -> None:
        """Go on at another time, s."""
        self._sought.append(min(max(round(time / self.log.dt), 0), len(self.log) - 1))

    def frames(self) -> Iterator[Frame]:
        """Yield the ticks to show in their order; after `seek`, from the tick that it named."""
        tick = 0
        while tick < len(self.log):
            if self._sought:
                tick = self._sought.pop()
            yield frame_of(self.log, tick)
            tick += 1
            if tick == len(self.log) and self.loop:
                tick = 0


class Motion:
    """Runs experiments live and replays logs, and shows them.

    Args:
        show: Called for every picture with its frame, first of all.

    Attributes:
        playback: The replay that runs, or None.
        lag: Largest delay of a tick behind its time in the current or last motion, s.
        pictures: Pictures shown in it.
        elapsed: Its length so far, s.
    """

    def __init__(self, show: Callable[[Frame], None]) -> None:
        self._show = show
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._stop = threading.Event()
        self._power: bool | None = None
        self.playback: Playback | None = None
        self.lag, self.pictures, self.elapsed = 0.0, 0, 0.0

    @property
    def running(self) -> bool:
        """Whether something moves the arm."""
        return self._thread is not None and self._thread.is_alive()

    @property
    def timing(self) -> str:
        """Duration and largest delay of the current or last motion, as text."""
        return f"took {self.elapsed:.1f} s, at most {1e3 * self.lag:.0f} ms behind time"

    def check_free(self) -> None:
        """Raise `TwinError` if something moves the arm."""
        if self.running:
            raise TwinError("the arm is moving; stop it first")

    def run(self, experiment: Experiment, *, speed: float | None = 1.0, watch: Watch, done: Done) -> None:
        """Run an experiment; returns at once.

        Args:
            experiment: The experiment.
            speed: Seconds of the experiment per second; None runs it as fast as it goes.
            watch: Called for every picture.
            done: Called at the end.

        Raises:
            TwinError: Something moves the arm already.
        """

        def work() -> None:
            live: LiveRun | None = None
            log: JointLog | None = None
            try:
                live = LiveRun(experiment)
                self._play(self._live_frames(live), lambda: speed, watch)
                reason = live.failure
            except (ValueError, OSError) as error:
                reason = str(error)
            # What was recorded before a failure is kept as well.
            if live is not None and live.tick:
                log = live.log()
            done(log, reason)

        self._start(work)

    def replay(
        self, log: JointLog, *, first: float = 0.0, speed: float = 1.0, loop: bool = False, watch: Watch, done: Done
    ) -> None:
        """Replay a log from a time on, s; returns at once, and `playback` steers it.

        Raises:
            TwinError: Something moves the arm already.
        """
        playback = Playback(log, first, speed=speed, loop=loop)

        def work() -> None:
            self._play(playback.frames(), lambda: playback.speed, watch)
            self.playback = None
            done(None, None)

        self._start(work, playback)

    def stop(self) -> None:
        """End the motion at the next tick and wait for its end; a run keeps what it recorded."""
        self._stop.set()
        thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join()

    def switch_power(self, *, on: bool) -> None:
        """Switch the servo power of a run from the next tick on: off is the emergency shutdown."""
        self._power = on

    def _start(self, work: Callable[[], None], playback: Playback | None = None) -> None:
        """Start the thread of a motion; raises `TwinError` if another one runs."""
        with self._lock:
            self.check_free()
            self._stop.clear()
            self._power, self.playback = None, playback
            self.lag, self.pictures, self.elapsed = 0.0, 0, 0.0
            self._thread = threading.Thread(target=work, daemon=True, name="motion")
            self._thread.start()

    def _live_frames(self, live: LiveRun) -> Iterator[Frame]:
        """Run an experiment and yield the arm after each tick."""
        while (frame := live.step()) is not None:
            yield frame
            # A switch requested by the page takes effect here, between two ticks and in the thread of the run.
            power, self._power = self._power, None
            if power is not None and live.tick < live.ticks:
                live.switch_power(on=power)

    def _play(self, frames: Iterator[Frame], speed: Callable[[], float | None], watch: Watch) -> None:
        """Show frames at their times, times the speed, until they end or the motion is stopped."""
        started, pace, next_tick = perf_counter(), speed(), -1
        next_picture = 0.0
        waiting: list[Frame] = []
        for frame in frames:
            clock = perf_counter()
            # The time scale starts anew after a jump and at another speed; otherwise the arm would leap to catch up.
            if frame.tick != next_tick or pace != speed():
                pace = speed()
                begin = clock - frame.time / (pace or 1.0)
            next_tick = frame.tick + 1
            waiting.append(frame)
            self.elapsed = clock - started
            due = clock if pace is None else begin + frame.time / pace
            self.lag = max(self.lag, clock - due)
            if clock >= next_picture:
                self._picture(waiting, watch)
                # Ticks and pictures have no common period: what was drawn late must not delay the next.
                next_picture, waiting = max(next_picture, clock - 1.0 / FRAME_RATE) + 1.0 / FRAME_RATE, []
            if self._stop.is_set():
                break
            if (ahead := due - perf_counter()) > 0.0:
                sleep(ahead)
        if waiting:
            self._picture(waiting, watch)

    def _picture(self, frames: list[Frame], watch: Watch) -> None:
        """Show the last of the frames since the picture before."""
        self._show(frames[-1])
        watch(frames)
        self.pictures += 1
