import os
import subprocess
import sys
import time

import psutil
import pytest

from scenarios.jobs.work import Work
from tests.refusals import refused
from tests.scenarios.station.conftest import wait_until
from tests.signals import default_signals


@pytest.fixture(scope="module")
def work():
    one = Work()
    yield one
    one.close()


def outcome(work, function, *arguments):
    ends = []
    work.start("a sum", function, *arguments, done=lambda value: ends.append(("done", value)), failed=ends.append)
    wait_until(lambda: ends)
    return ends[0]


def test_the_result_of_the_child_comes_back(work):
    assert outcome(work, divmod, 7, 2) == ("done", (3, 1))
    assert work.label == ""


def test_an_error_is_one_line(work):
    assert outcome(work, int, "a\nb") == "a sum: invalid literal for int() with base 10: 'a\\nb'"


def test_work_is_stopped_and_the_next_one_goes_on(work):
    ends = []
    work.start("a nap", time.sleep, 600.0, done=ends.append, failed=ends.append)
    refused("a nap is being computed", work.start, "more", abs, 1, done=ends.append, failed=ends.append)
    assert work.elapsed > 0.0
    work.stop()
    wait_until(lambda: ends)
    assert ends == ["a nap was stopped"]
    assert outcome(work, abs, -1) == ("done", 1)
    work.stop()  # nothing is computed, nothing happens


def test_a_keyboard_interrupt_of_the_whole_terminal_ends_it_without_a_word():
    program = (
        "import os, signal, time\n"
        "from scenarios.jobs.work import Work\n"
        "if __name__ == '__main__':\n"
        "    work = Work()\n"
        "    work.start('a nap', time.sleep, 600.0, done=print, failed=print)\n"
        "    for wait in (0.05, 0.5):\n"
        "        try:\n"
        "            time.sleep(wait)\n"
        "            os.killpg(os.getpgrp(), signal.SIGINT)\n"
        "            time.sleep(1)\n"
        "        except KeyboardInterrupt:\n"
        "            print(work.label)\n"
        "    work.close()\n"
    )
    run = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        cwd=os.getcwd(),
        check=False,
        start_new_session=True,
        preexec_fn=default_signals,
        timeout=60,
    )
    assert (run.returncode, run.stdout, run.stderr) == (0, "a nap\na nap\n", "")


def test_the_child_ends_with_the_station_however_that_ends():
    program = (
        "import os, signal\n"
        "from scenarios.jobs.work import Work\n"
        "if __name__ == '__main__':\n"
        "    print(Work()._child.result(), flush=True)\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=os.getcwd(), check=False)
    child = int(run.stdout)
    wait_until(lambda: not psutil.pid_exists(child) or psutil.Process(child).status() == psutil.STATUS_ZOMBIE)
