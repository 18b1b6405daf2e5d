"""A JSON object's members come one after the other, and what is no JSON is refused as the standard library does."""

import json

import pytest

from automos.core.json_members import each_member

GOOD = [
    "{}",
    ' { "a" : 1 ,\n "t" : [ ] } ',
    '{"t": [1, {"a": [2]}, [3]], "b": null}',
    '{"t": {"t": [1]}}',
    '{"a": {"t": [1, 2]}, "t": 5}',
]
BAD = [
    "", "[]", "{", '{"a"}', '{"a":}', '{"a":1,}', '{"t":[1,]}', '{"t":[1}', "{1:2}", "{} x", '{"t":[1]]}',
    '{"t":[1 2]}', '{"a":1 "b":2}', '{"t":' + "[" * 100_000, '{"t":[' + "[" * 100_000, "{'a':1}", "\ufeff{}",
]  # fmt: skip


@pytest.mark.parametrize("text", GOOD)
def test_the_members_are_those_that_json_has(text):
    found = {}
    for name, value in each_member(text, "t"):
        if name is None:
            found["t"].append(value)
        else:
            found[name] = value
    assert found == json.loads(text)


@pytest.mark.parametrize("text", BAD, ids=lambda text: text[:15])
def test_what_is_no_object_of_json_is_refused(text):
    with pytest.raises(ValueError, match=r"Expecting|Extra data|nested too deeply|not a name"):
        list(each_member(text, "t"))


def test_what_a_list_holds_comes_before_its_end_is_read():
    members = each_member('{"t": [1, 2, oops', "t")
    assert [next(members) for _ in range(3)] == [("t", []), (None, 1), (None, 2)]
