"""Forms: what is wrong stands beneath the field that is wrong, and only the last state is made."""

import threading

from scenarios.station.fields import Field, Form, shown
from tests.scenarios.station.conftest import wait_until


def test_a_number_that_may_be_left_out_and_values_of_any_digits(page):
    _, client = page
    form = Form(client.gui, [Field("rate", "rate / Hz", None, optional=float), Field("count", "count", 3)], dict)
    assert form.record() == {"rate": None, "count": 3}
    form.set({"rate": 0.1 + 0.2, "count": 4})
    assert form.record() == {"rate": 0.1 + 0.2, "count": 4}
    assert form.handles["rate"].value == "0.30000000000000004"
    assert shown(0.1) == "0.1"
    form.handles["rate"].value = "fast"
    assert form.record() is None
    assert form._messages["rate"].text == "expected a number or nothing, given 'fast'"


def test_values_are_put_in_as_one_change(page):
    _, client = page
    records = []
    form = Form(client.gui, [Field("low", "low", 1.0), Field("high", "high", 2.0)], dict, records.append)
    form.set({"low": 5.0, "high": 6.0})
    form.set({"low": 5.0, "high": 6.0})
    assert records == [{"low": 5.0, "high": 6.0}]


def test_of_what_is_typed_meanwhile_only_the_last_is_made(page):
    _, client = page
    records, begun, go_on = [], threading.Event(), threading.Event()

    def changed(record):
        records.append(record["text"])
        begun.set()
        go_on.wait(10.0)

    form = Form(client.gui, [Field("text", "text", "")], dict, changed)

    def type_in(text):
        form.handles["text"].value = text

    threads = [threading.Thread(target=type_in, args=("a",))]
    threads[0].start()
    begun.wait(10.0)
    for text in ("ab", "abc", "abcd"):
        threads.append(threading.Thread(target=type_in, args=(text,)))
        threads[-1].start()
        wait_until(lambda: form._changes == len(threads))
    go_on.set()
    for thread in threads:
        thread.join(10.0)
    assert records == ["a", "abcd"]
