"""Batches on the workers of a Dask scheduler: lost schedulers are waited for, other software is refused."""

import socket
import subprocess
import sys
from contextlib import ExitStack, suppress
from threading import Thread
from time import monotonic, sleep

import dask
import pytest

from scenarios.jobs import bitwise_compatibility, cluster
from scenarios.jobs.bitwise_compatibility import ROUNDING, bit_differences, bit_fingerprint
from scenarios.jobs.cluster import Cluster
from tests.benchmarks.tables import environment
from tests.refusals import refused
from tests.scenarios.jobs import tasks

distributed = pytest.importorskip("distributed")


def test_batches_run_on_workers(scheduler):
    with Cluster(scheduler, patience=20.0) as executor:
        assert sorted(executor.run(tasks.double, 2, [(1, 2), (3,)])) == [2, 4, 6]
        assert list(executor.run(tasks.double, 3, [(1,)])) == [3]
        assert (executor.workers, executor.local) == (1, False)
        with pytest.raises(ValueError, match="of the worker, a"):
            list(executor.run(tasks.wrong, None, [("a",)]))


@pytest.mark.reliability
@pytest.mark.parametrize("deaths", [3, 0])
def test_a_dead_worker_is_replaced_and_a_scheduler_that_has_gone_is_waited_for(tmp_path, deaths):
    """After so many deaths of workers the scheduler gives a batch up, whose items then run one by one."""
    lines = []
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    scheduler = ("distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard")
    worker = ("distributed.cli.dask_worker", address, "--no-dashboard", "--no-nanny", "--nthreads", "1")
    with ExitStack() as stack:

        def start(*command):
            allowed = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": str(deaths)}
            settings = {**environment(), **allowed}
            process = subprocess.Popen([sys.executable, "-m", *command], env=settings, stderr=subprocess.DEVNULL)
            stack.callback(process.wait)
            stack.callback(process.kill)
            return process

        def report(line):
            lines.append(line)
            if "has gone; waiting up to" in line:  # the workers with it
                start(*scheduler)
                start(*worker)

        first = start(*scheduler)
        start(*worker)
        start(*worker)
        end = monotonic() + 60.0
        while monotonic() < end:
            with suppress(OSError), socket.create_connection(("127.0.0.1", port)):
                break
            sleep(0.1)
        with Cluster(address, patience=60.0, report=report) as executor:
            assert sorted(executor.run(tasks.mortal, str(tmp_path), [("a",), ("once", "b")])) == ["a", "b", "once"]
            assert any("they run one by one" in line for line in lines) == (deaths == 0)
            if not deaths:
                return
            results = executor.run(tasks.slow, 0.2, ((number,) for number in range(10)))
            done = [next(results)]
            first.kill()
            first.wait()
            assert sorted([*done, *results]) == list(range(10))


@pytest.mark.parametrize("address", ["", "junk:1", "http://a:1", "tcp://a", "tcp://a:0", "tcp://a:99999", "tcp://:1"])
def test_no_address_is_refused_at_once(address):
    refused("expected the address of a Dask scheduler", Cluster, address)


def doubled(address, **options):
    with Cluster(address, **options) as executor:
        return list(executor.run(tasks.double, 1, [(1,)]))


def test_tls_needs_certificates_that_can_be_read():
    refused("without certificates; expected distributed.comm.tls.ca-file", Cluster, "tls://127.0.0.1:8786")
    files = dict.fromkeys(("ca-file", "client.cert", "client.key"), "missing.pem")
    with dask.config.set({f"distributed.comm.tls.{name}": file for name, file in files.items()}):
        refused("certificates in Dask's configuration cannot be read", Cluster, "tls://127.0.0.1:8786")


@pytest.mark.parametrize("greeting", [b"", b"HTTP/1.0 400\r\n\r\n", None, "nobody"])
def test_no_scheduler_is_reported_within_seconds(greeting):
    with ExitStack() as stack:
        server = stack.enter_context(socket.create_server(("127.0.0.1", 0)))

        def answer():
            with suppress(OSError):
                while True:
                    connection = stack.enter_context(server.accept()[0])
                    connection.close() if greeting is None else connection.sendall(greeting)

        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        if greeting == "nobody":
            server.close()
        else:
            Thread(target=answer, daemon=True).start()
        refused(r"no Dask scheduler answers at '.*' within 0\.5 s", doubled, address, patience=0.5)


def test_workers_that_never_come_end_a_run_that_can_resume():
    lines = []
    with distributed.LocalCluster(n_workers=0, dashboard_address=None, host="127.0.0.1") as empty:
        message = r"has no workers; waited for 0\.5 s; .* run the command again to resume"
        refused(message, doubled, empty.scheduler_address, patience=0.5, report=lines.append)
    assert len(lines) == 1 and "waiting up to" in lines[0]


def test_workers_with_other_software_are_refused(scheduler, monkeypatch):
    monkeypatch.setattr(cluster, "bit_differences", lambda expected: ["numpy 2.0 here, 0.1 there"])
    message = r"worker tcp://\S+ would compute other bits .*: numpy 2\.0 here, 0\.1 there"
    refused(message, doubled, scheduler, patience=20.0)


def test_differences_of_software_and_rounding_are_named():
    here = dict(bit_fingerprint())
    assert bit_differences(here) == []
    other = {**here, "numpy": "0.1", "source": "f" * 64, ROUNDING: "another"}
    del other["scipy"]
    assert sorted(bit_differences(other)) == [
        "its processor rounds differently",
        f"numpy 0.1 here, {here['numpy']} there",
        f"scipy none here, {here['scipy']} there",
        f"source {'f' * 12} here, {here['source'][:12]} there",
    ]
    assert bitwise_compatibility._rounding() == here[ROUNDING]
