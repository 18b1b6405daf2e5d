import subprocess
import sys

import numpy as np
import pytest

from automos.core.claims import RESULTS, claim
from automos.core.errors import InputError
from automos.readers import CODECS, FORMATS, open_recordings, open_sequence


def make_scans(folder, n_scans=2):
    folder.mkdir(parents=True)
    for i in range(n_scans):
        np.zeros((3, 4), np.float32).tofile(folder / f"{i:06d}.bin")


def test_a_dataset_root_gives_its_recordings_in_natural_order(tmp_path):
    for name in ("10", "2", "1"):
        make_scans(tmp_path / "sequences" / name / "velodyne")
    (tmp_path / "sequences" / ".hidden" / "velodyne").mkdir(parents=True)
    (tmp_path / "sequences" / "notes").mkdir()
    assert [sequence.name for sequence in open_recordings(tmp_path)] == ["1", "2", "10"]
    assert [sequence.name for sequence in open_recordings(tmp_path / "sequences")] == ["1", "2", "10"]
    assert [sequence.name for sequence in open_recordings(tmp_path / "sequences" / "2")] == ["2"]


def test_one_sequence_is_asked_for_and_several_are_there(tmp_path):
    make_scans(tmp_path / "sequences" / "00" / "velodyne")
    assert open_sequence(tmp_path).name == "00"
    make_scans(tmp_path / "sequences" / "01" / "velodyne")
    with pytest.raises(InputError, match=r"holds 2 recordings \(00, 01\); give one"):
        open_sequence(tmp_path)


def test_a_plain_folder_is_one_recording(tmp_path):
    make_scans(tmp_path / "log")
    (sequence,) = open_recordings(str(tmp_path / "log"))
    assert (sequence.name, len(sequence)) == ("log", 2)


def test_a_slice_of_a_recording_is_refused_with_what_to_write_instead(tmp_path):
    make_scans(tmp_path / "log", 3)
    recording = open_sequence(tmp_path / "log")
    with pytest.raises(InputError, match=r"one scan at a time: write \[recording\[i\] for i in range\(1, 3\)\]"):
        recording[1:]
    assert recording[-1].name == recording[np.int64(2)].name == "000002"
    with pytest.raises(IndexError):
        recording[3]


def test_the_name_is_that_of_the_folder_however_it_was_reached(tmp_path, monkeypatch):
    make_scans(tmp_path / "log")
    monkeypatch.chdir(tmp_path / "log")
    assert open_sequence(".").name == "log"


def test_a_format_overrides_the_guess(tmp_path):
    make_scans(tmp_path / "log" / "velodyne")
    assert len(open_sequence(tmp_path / "log", "kitti")) == 2
    assert len(open_sequence(tmp_path / "log" / "velodyne", "folder")) == 2
    assert len(open_sequence(tmp_path / "log", "bin3")[0]) == 4
    with pytest.raises(InputError, match="no scans for format 'pcd'"):
        open_sequence(tmp_path / "log", "pcd")
    with pytest.raises(InputError, match="no recording of format 'kitti'"):
        open_sequence(tmp_path / "log" / "velodyne", "kitti")


@pytest.mark.parametrize(("format", "near"), [("kiti", "kitti"), ("PDC", "pcd"), ("binary", "bin"), ("bin4", "bin")])
def test_an_unknown_format_names_the_nearest_and_all_others(tmp_path, format, near):
    with pytest.raises(InputError, match=f"unknown format '{format}'; did you mean '{near}") as error:
        open_sequence(tmp_path, format)
    assert all(name in str(error.value) for name in [*FORMATS, *CODECS])


def test_a_path_that_holds_no_recording_is_told_in_one_sentence(tmp_path):
    with pytest.raises(InputError, match=r"nowhere does not exist; check the path"):
        open_sequence(tmp_path / "nowhere")
    with pytest.raises(InputError, match="is empty"):
        open_sequence(tmp_path)
    (tmp_path / "velodyne").mkdir()
    with pytest.raises(InputError, match="velodyne holds no scans"):
        open_sequence(tmp_path)
    (tmp_path / "velodyne").rmdir()
    (tmp_path / "picture.png").touch()
    with pytest.raises(InputError, match="holds no point files; a recording is"):
        open_sequence(tmp_path)
    with pytest.raises(InputError, match="is a file; give the folder"):
        open_sequence(tmp_path / "picture.png")
    claim(tmp_path / "run", RESULTS)
    (tmp_path / "run" / "poses.txt").touch()
    with pytest.raises(InputError, match="holds results that automos wrote, and no scans: give the recording itself"):
        open_sequence(tmp_path / "run")


def test_folders_of_scans_inside_the_given_one_are_named(tmp_path):
    make_scans(tmp_path / "run1")
    make_scans(tmp_path / "run2")
    with pytest.raises(InputError, match="these folders in it do: run1, run2; give one of them"):
        open_sequence(tmp_path)


def test_a_format_is_imported_only_when_it_is_used(tmp_path):
    make_scans(tmp_path / "log")
    program = (
        "import sys; from automos.readers import open_sequence; "
        f"len(open_sequence({str(tmp_path / 'log')!r})[0]); "
        "print([m for m in sys.modules if m.startswith('automos.readers.')])"
    )
    loaded = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True).stdout
    assert "automos.readers.bin" in loaded
    for unused in ("pcd", "ply", "npy", "xyz", "lzf"):
        assert f"automos.readers.{unused}'" not in loaded
