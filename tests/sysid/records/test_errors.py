import pickle

import pytest

from sysid import SysidError, SysidWarning
from sysid.records.errors import Message, reworded

ADVICE = "; stable=True forbids it"
MESSAGE = Message("the model is unstable" + ADVICE, "unstable-model", stable=ADVICE)


@pytest.mark.parametrize("kind", [SysidError, SysidWarning])
def test_errors_and_warnings_carry_the_code_of_a_message_and_its_advice_also_to_another_process(kind):
    for raised in (kind(MESSAGE), pickle.loads(pickle.dumps(kind(MESSAGE)))):
        assert str(raised) == MESSAGE
        assert (raised.code, raised.advice) == ("unstable-model", {"stable": ADVICE})
    plain = kind("no advice")
    assert (str(plain), plain.code, plain.advice) == ("no advice", "", {})


def test_a_message_stays_a_text_and_its_advice_takes_other_words_or_none():
    copy = pickle.loads(pickle.dumps(MESSAGE))
    assert copy == MESSAGE
    assert copy.code == MESSAGE.code
    assert reworded(f"data.csv: {copy}", copy.advice, {}) == "data.csv: the model is unstable"
    assert reworded(copy, copy.advice, {"stable": "; --stable"}) == "the model is unstable; --stable"
