import gzip
import lzma
import tarfile

import pytest

from automos.core.errors import InputError
from automos.readers import open_sequence
from automos.readers.other_files import what_to_do


def packed(kind, path, content):
    path.write_bytes({"gzip": gzip.compress, "xz": lzma.compress}[kind](content))
    return path


@pytest.mark.parametrize(
    ("kind", "name", "command"),
    [
        ("gzip", "drive.bag.gz", r"gunzip -k drive\.bag\.gz"),
        ("gzip", "drive.tgz", r"gunzip -k drive\.tgz"),
        ("gzip", "drive.pcap", r"no packets of a known|gunzip"),
        ("xz", "drive.mcap.xz", r"unxz -k drive\.mcap\.xz"),
    ],
)
def test_what_is_compressed_is_to_be_unpacked_and_is_not_called_damaged(tmp_path, kind, name, command):
    path = packed(kind, tmp_path / name, bytes(1000))
    with pytest.raises(InputError, match=command) as told:
        open_sequence(path)
    assert "damaged" not in str(told.value)


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("recording", b"\x89MCAP0\r\n" + bytes(40), "rename it to recording.mcap"),
        ("log.txt2", b"#ROSBAG V2.0\n" + bytes(40), "rename it to log.txt2.bag"),
        ("renamed.bin2", b"livox_tech".ljust(16, b"\0"), "Livox's viewer"),
        ("drive.pcap1", b"\xd4\xc3\xb2\xa1" + bytes(20), "rename it to drive.pcap1.pcap"),
    ],
)
def test_recordings_of_other_kinds_are_named_with_what_converts_them(tmp_path, name, content, told):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=rf"{name} is an? .*{told}"):
        open_sequence(tmp_path / name)
    with pytest.raises(InputError, match=told):
        open_sequence(tmp_path)  # a folder of nothing else


def test_of_an_archive_in_a_folder_and_of_what_is_unknown(tmp_path):
    with tarfile.open(tmp_path / "drive.tar", "w"):
        pass
    with pytest.raises(InputError, match=r"drive.tar is an archive \(tar\).*tar -xf drive.tar"):
        open_sequence(tmp_path)
    (tmp_path / "notes.doc").write_bytes(b"notes")
    assert what_to_do(tmp_path / "notes.doc") is None
    assert what_to_do(tmp_path) is None
    with pytest.raises(InputError, match=r"notes.doc is a file; give the folder"):
        open_sequence(tmp_path / "notes.doc")
