"""The log of decisions: only ever added to, read back as written, forgiving of a crash and of nothing else."""

import errno
import os
import re

import numpy as np
import pytest

from automos.core.errors import InputError
from automos.review import log
from automos.review.decisions import Cover, Decision, append_decisions, cover, read_decisions
from automos.review.log import LOG_FILE, key_of_changes

ONE = Decision("2026-01-02T03:04:05+00:00", 3, "moving", "static", "key", {"000001": Cover(2, [5, 9])})
TWO = Decision("2026-01-02T03:05:05+00:00", 3, "undo", "static", "key", {})


def test_decisions_are_read_back_as_they_were_written(tmp_path):
    assert read_decisions(tmp_path) == []
    append_decisions(tmp_path, [ONE])
    first = (tmp_path / LOG_FILE).read_bytes()
    append_decisions(tmp_path, [TWO])
    assert (tmp_path / LOG_FILE).read_bytes().startswith(first)
    assert read_decisions(tmp_path) == [ONE, TWO]


def test_a_line_cut_short_by_a_crash_is_passed_over_and_swallows_none(tmp_path):
    append_decisions(tmp_path, [ONE])
    with (tmp_path / LOG_FILE).open("a") as file:
        file.write('{"at": "2026-01-02T0')
    assert read_decisions(tmp_path) == [ONE]
    append_decisions(tmp_path, [TWO])
    assert read_decisions(tmp_path) == [ONE, TWO]


def test_of_what_could_not_be_logged_nothing_holds(tmp_path, monkeypatch):
    append_decisions(tmp_path, [ONE])
    before = (tmp_path / LOG_FILE).read_bytes()

    def full_disk(handle):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(InputError, match="No space left"):
        append_decisions(tmp_path, [TWO])
    assert (tmp_path / LOG_FILE).read_bytes() == before


@pytest.mark.parametrize("line", [b'{"at": }', b'{"at": "x"}', b'{"at": "2026', b"[]", b"3", b"\xff\xfe", b"{" * 9999])
def test_a_damaged_line_is_named_and_stays_and_the_others_are_read(tmp_path, caplog, line):
    append_decisions(tmp_path, [ONE])
    with (tmp_path / LOG_FILE).open("ab") as file:
        file.write(line)
    append_decisions(tmp_path, [TWO])
    assert read_decisions(tmp_path) == [ONE, TWO]
    assert re.search(
        r"review.jsonl, line 2 is not a (decision|line of a review) \(.*\): it stays, but is passed over", caplog.text
    )
    assert line in (tmp_path / LOG_FILE).read_bytes()


def test_labels_are_made_again_when_a_damaged_line_is_mended(tmp_path):
    append_decisions(tmp_path, [ONE, TWO])
    before, text = key_of_changes(tmp_path), (tmp_path / LOG_FILE).read_text()
    (tmp_path / LOG_FILE).write_text(text.replace("{", "", 1))
    assert len({before, key_of_changes(tmp_path), ""}) == 3
    (tmp_path / LOG_FILE).write_text(text)
    assert key_of_changes(tmp_path) == before


def test_a_log_grows_no_larger_than_what_is_read(tmp_path, monkeypatch):
    append_decisions(tmp_path, [ONE])
    monkeypatch.setattr(log, "MAX_TEXT", 2 * (tmp_path / LOG_FILE).stat().st_size - 1)
    with pytest.raises(InputError, match="is full"):
        append_decisions(tmp_path, [ONE])
    assert read_decisions(tmp_path) == [ONE]


def test_a_cover_keeps_some_rows_and_the_number_of_all():
    assert cover(np.array([4, 7])) == Cover(2, [4, 7])
    some = cover(np.arange(1000), most=5)
    assert some == Cover(1000, [0, 249, 499, 749, 999])
