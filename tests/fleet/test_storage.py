"""A store that fails for a while is asked again; what cannot pass is told at once; nothing secret is told at all."""

import errno

import pytest

from automos.core.claims import MARK
from automos.core.errors import InputError, MissingExtraError
from automos.fleet import storage
from automos.fleet.publishing import MARKER, Marker, publish, read_marker, require_ours, withdraw
from automos.fleet.storage import Store, StoreError, is_url, join, patiently


@pytest.fixture
def clock(monkeypatch):
    """Return a list of the pauses made; time passes by them alone."""
    pauses = []
    monkeypatch.setattr(storage.time, "monotonic", lambda: sum(pauses))
    monkeypatch.setattr(storage.time, "sleep", pauses.append)
    return pauses


def test_a_request_is_made_again_until_the_store_answers(clock):
    answers = iter([ConnectionResetError(), TimeoutError(), OSError("503 slow down"), "here"])

    def ask():
        answer = next(answers)
        if isinstance(answer, Exception):
            raise answer
        return answer

    assert patiently(ask, "reading") == "here"
    assert clock == [0.5, 1.0, 2.0]


def test_a_store_that_stays_away_is_given_up_after_two_minutes(clock):
    def ask():
        raise ConnectionRefusedError("nobody there")

    with pytest.raises(StoreError, match="reading failed for 120 s, last with: nobody there"):
        patiently(ask, "reading")
    assert 100 < sum(clock) <= 120


@pytest.mark.parametrize(
    ("error", "word"),
    [
        (FileNotFoundError(), "does not exist"),
        (PermissionError("Access Denied"), "Access Denied"),
        (OSError(errno.ENOSPC, "No space left on device"), "No space left"),
    ],
)
def test_what_cannot_pass_is_told_at_once(clock, error, word):
    def ask():
        raise error

    with pytest.raises(InputError, match=word):
        patiently(ask, "reading")
    assert clock == []


def test_a_bug_is_no_fault_of_the_store(clock):
    with pytest.raises(ZeroDivisionError):
        patiently(lambda: 1 // 0, "reading")


def test_what_is_secret_in_an_address_is_told_nowhere(clock):
    def ask():
        raise OSError("cannot reach https://me:pass@host/a?sig=abc&x=1 now")

    with pytest.raises(StoreError) as told:
        patiently(ask, "reading")
    assert "host/a" in str(told.value)
    assert not any(secret in str(told.value) for secret in ("pass", "abc", "me:"))


def test_addresses_are_told_from_paths():
    assert [is_url(text) for text in ("s3://a/b", "abfss://c@d/e", "/a/b", "a://", "C:\\logs", "logs/a:b")] == [
        True, True, False, False, False, False,
    ]  # fmt: skip
    assert join("s3://a/", "/b/", "", "c") == "s3://a/b/c"


def test_a_kind_of_store_whose_package_is_missing_is_told_with_what_to_install():
    pytest.importorskip("fsspec", reason="fsspec is not installed: pip install '.[scale]'")
    try:
        import gcsfs  # noqa: F401
    except ImportError:
        with pytest.raises(MissingExtraError, match=r"\[gcs\]"):
            Store("gs://bucket/logs")
    with pytest.raises(InputError, match="cannot be opened"):
        Store("nosuchstore://bucket/logs")


# ------------------------------------------------------------------------------------------------------- publishing
MADE = Marker("source", "settings", "fingerprint", {"scans": 1}, ("thick walls",))


@pytest.fixture
def results(tmp_path):
    """Return a folder with the files of a run."""
    folder = tmp_path / "results"
    (folder / "predictions").mkdir(parents=True)
    (folder / "stages" / "odometry").mkdir(parents=True)
    (folder / "stages" / "odometry" / "all.npz").write_bytes(b"costly")
    (folder / "predictions" / "0.label").write_bytes(b"label")
    (folder / "run.json").write_text('{"recording": {"source": "/cache/a"}}')
    return folder


@pytest.fixture
def target():
    """Return the URL of an empty place in a store in memory."""
    files = pytest.importorskip("fsspec", reason="fsspec is not installed: pip install '.[scale]'").filesystem("memory")
    if files.exists("/out"):
        files.rm("/out", recursive=True)
    return "memory://out/a"


def test_results_arrive_with_a_marker_that_names_them_all_but_not_the_stages(results, target):
    publish(results, target, MADE, "s3://bucket/a?sig=x")
    assert [entry.path for entry in Store(target).entries()] == [MARK, MARKER, "predictions/0.label", "run.json"]
    marker = read_marker(target)
    assert (marker.fingerprint, marker.counts, marker.warnings) == ("fingerprint", {"scans": 1}, ["thick walls"])
    assert marker.files["predictions/0.label"]["bytes"] == 5
    assert b"s3://bucket/a" in Store(target).read("run.json")
    assert b"sig" not in Store(target).read("run.json")


def test_files_of_results_that_are_replaced_do_not_stay(results, target):
    Store(target).write("predictions/9.label", b"old")
    publish(results, target, MADE, "/logs/a")
    assert "predictions/9.label" not in [entry.path for entry in Store(target).entries()]


def test_files_that_are_no_results_stay_whatever_lies_beside_results(results, target):
    for path in ("velodyne/0.bin", "labels/0.label", "log01/predictions/0.label"):
        Store(target).write(path, b"theirs")
    publish(results, target, MADE, "/logs/a")
    assert len(Store(target).entries()) == 3 + 4


@pytest.mark.parametrize("path", ["predictions/9.label", "confidences/9.npy", "poses.txt"])
def test_what_results_would_replace_and_automos_did_not_write_is_not_touched(results, target, tmp_path, path):
    require_ours(target)
    require_ours(str(tmp_path / "empty"))
    Store(target).write(path, b"theirs")
    (tmp_path / "theirs" / path).parent.mkdir(parents=True)
    (tmp_path / "theirs" / path).write_bytes(b"theirs")
    Store(target).write("run.json", b'{"tool": "theirs"}')
    with pytest.raises(InputError, match=f"holds {path}, which automos did not write: choose another --out"):
        require_ours(target)
    with pytest.raises(InputError, match="automos did not make that folder: choose another --out"):
        require_ours(str(tmp_path / "theirs"))
    Store(target).write("run.json", b'{"recording": {}, "points": {}, "versions": {"automos": "0.6.0"}}')
    require_ours(target)


def test_an_upload_that_was_interrupted_is_known_to_be_ours(results, target, monkeypatch):
    put = Store.put

    def broken(self, local, path):
        if path.endswith("0.label"):
            raise StoreError("away")
        put(self, local, path)

    (results / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0")
    monkeypatch.setattr(Store, "put", broken)
    with pytest.raises(StoreError):
        publish(results, target, MADE, "/logs/a")
    require_ours(target)


@pytest.mark.parametrize("damage", ["lost", "shorter", "other"])
def test_what_does_not_arrive_as_sent_gets_no_marker(results, target, monkeypatch, damage):
    put = Store.put

    def damaged(self, local, path):
        put(self, local, path)
        if path.endswith(".label"):
            self.remove([path])
            if damage != "lost":
                self.write(path, b"lab" if damage == "shorter" else b"LABEL")

    publish(results, target, MADE, "/logs/a")
    monkeypatch.setattr(Store, "put", damaged)
    with pytest.raises(StoreError, match=r"predictions/0\.label"):
        publish(results, target, MADE, "/logs/a")
    assert read_marker(target) is None


def test_results_withdrawn_are_none(results, target):
    publish(results, target, MADE, "/logs/a")
    withdraw(target)
    assert read_marker(target) is None
    withdraw(target)


def test_on_a_disk_the_marker_is_written_beside_the_results(results):
    publish(results, str(results), MADE, "/logs/a")
    assert read_marker(str(results)).files.keys() == {"predictions/0.label", "run.json"}
    (results / MARKER).write_text("{half")
    assert read_marker(str(results)) is None


def test_results_whose_labels_were_damaged_since_are_not_complete(results, target):
    for place in (str(results), target):
        publish(results, place, MADE, "/logs/a")
        assert read_marker(place) is not None
    (results / "run.json").write_text("{}")  # as a review may
    assert read_marker(str(results)) is not None
    (results / "predictions" / "0.label").write_bytes(b"label and more")
    assert read_marker(str(results)) is None
    Store(target).remove(["predictions/0.label"])
    assert read_marker(target) is None


@pytest.mark.parametrize(
    "files", ['"x"', "[1]", '{"predictions/0.label": 3}', '{"predictions/0.label": {"bytes": []}}']
)
def test_a_marker_of_another_form_is_none(results, files):
    (results / MARKER).write_text(f'{{"source": "", "settings": "", "fingerprint": "", "files": {files}}}')
    assert read_marker(str(results)) is None
