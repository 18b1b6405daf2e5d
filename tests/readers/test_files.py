import numpy as np
import pytest

from automos.core.errors import InputError
from automos.readers import open_sequence
from automos.readers.files import list_scans, natural_key, stamps_from_names


def touch(folder, *names):
    folder.mkdir(exist_ok=True)
    for name in names:
        (folder / name).touch()
    return folder


def test_numbers_in_names_sort_as_numbers():
    names = ["scan10.bin", "scan2.bin", "scan1.bin", "scan01.bin", "a.bin", "7.bin"]
    assert sorted(names, key=natural_key) == ["7.bin", "a.bin", "scan01.bin", "scan1.bin", "scan2.bin", "scan10.bin"]


def test_scans_come_in_natural_order(tmp_path):
    names, codec, stamps = list_scans(touch(tmp_path, "10.pcd", "2.pcd", "1.pcd"))
    assert (names, codec, stamps) == (["1.pcd", "2.pcd", "10.pcd"], "pcd", None)


def test_hidden_files_and_files_beside_the_scans_are_no_scans(tmp_path):
    touch(tmp_path, "0.bin", "1.BIN", "._0.bin", ".cache.pcd", "poses.txt", "times.txt", "calib.txt")
    touch(tmp_path, "notes.txt", "a.csv", "picture.png")
    (tmp_path / "old.bin").mkdir()
    assert list_scans(tmp_path)[0] == ["0.bin", "1.BIN"]


@pytest.mark.parametrize(
    "names",
    [
        ["front_000000.pcd", "front_000001.pcd", "rear_000000.pcd", "rear_000001.pcd"],
        ["0.bin", "0_ground.bin", "1.bin", "1_ground.bin"],
        [f"car_lidar{k}_{1561000444390857630 + k * 1000 + i * 10**8}.bin" for i in range(3) for k in range(2)],
    ],
)
def test_scans_of_several_sensors_in_a_folder_are_told_by_their_names(tmp_path, names):
    with pytest.raises(InputError, match="holds scans of several sensors or drives, as their names tell"):
        list_scans(touch(tmp_path, *names))


def test_names_that_go_on_under_other_words_or_have_them_for_each_are_of_one_series(tmp_path):
    for i, names in enumerate((["a_1.bin", "a_2.bin", "b_3.bin", "b_4.bin"], ["scan1.bin", "scan2.bin", "last1.bin"])):
        assert len(list_scans(touch(tmp_path / str(i), *names))[0]) == len(names)


@pytest.mark.parametrize("suffix", [".tsv", ".asc", ".pts"])
def test_text_has_many_names(tmp_path, suffix):
    for k in range(3):
        rows = "\n".join(f"{i} {i * k % 7} {-i * i % 5} {i % 9}" for i in range(40))
        (tmp_path / f"{k}{suffix}").write_text(f"40\n{rows}\n" if suffix == ".pts" else rows)
    assert [len(scan) for scan in open_sequence(tmp_path)] == [40, 40, 40]


def test_a_folder_of_notes_is_no_recording(tmp_path):
    (tmp_path / "notes.txt").write_text("taken on the 3rd of May, 2 turns, 14 km\n")
    with pytest.raises(InputError, match="no point files"):
        open_sequence(tmp_path)


def test_text_files_are_scans_where_there_are_no_others(tmp_path):
    assert list_scans(touch(tmp_path, "1.txt", "2.txt", "poses.txt"))[:2] == (["1.txt", "2.txt"], "xyz")


def test_mixed_formats_are_counted(tmp_path):
    touch(tmp_path, "0.bin", "1.bin", "2.bin", "0.pcd", "1.ply")
    with pytest.raises(InputError, match=r"mixes formats: 3 \.bin, 1 \.(pcd|ply), 1 \.(pcd|ply); keep one kind"):
        list_scans(tmp_path)


def test_a_named_codec_picks_its_files_of_a_mixed_folder(tmp_path):
    touch(tmp_path, "0.bin", "1.bin", "0.pcd")
    assert list_scans(tmp_path, "bin5")[0] == ["0.bin", "1.bin"]
    with pytest.raises(InputError, match="no scans for format 'ply'"):
        list_scans(tmp_path, "ply")


@pytest.mark.parametrize(
    ("names", "stamps"),
    [
        (["1561000444390857630.bin", "1561000444490857630.bin"], [1561000444.39085763, 1561000444.49085763]),
        (["1561000444390857.bin", "1561000444490857.bin"], [1561000444.390857, 1561000444.490857]),
        (["1561000444390.bin", "1561000444490.bin"], [1561000444.39, 1561000444.49]),
        (["1561000444.bin", "1561000445.bin"], [1561000444, 1561000445]),
        (["1561000444_390857630.pcd", "1561000444_490857630.pcd"], [1561000444.39085763, 1561000444.49085763]),
        (["1561000444-090857630.pcd", "1561000444-190857630.pcd"], [1561000444.09085763, 1561000444.19085763]),
        (["lidar_12.500000.ply", "lidar_12.600000.ply"], [12.5, 12.6]),
        (
            [
                "n015-2018-07-24__TOP__1532402927647951.pcd.bin",
                "n015-2018-07-24__TOP__1532402927697951.pcd.bin",
            ],
            [1532402927.647951, 1532402927.697951],
        ),
    ],
)
def test_stamps_are_read_from_names(names, stamps):
    np.testing.assert_allclose(stamps_from_names(names), stamps, rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    "names",
    [
        ["000000.bin", "000001.bin"],
        ["2011_09_26_0005_0000000000.bin", "2011_09_26_0005_0000000001.bin"],
        ["a.bin", "b.bin"],
        ["1561000444390857630.bin"],
        ["1561000444390857630.bin", "first.bin"],
        pytest.param(["1561000444390857630.bin", "1561000444390857631.bin"], id="too close to be scans"),
        pytest.param(["1561000444.bin", "1561009999.bin"], id="too far apart to be scans"),
        pytest.param(["part_1.1.bin", "part_1.2.bin", "part_1.10.bin", "part_1.20.bin"], id="versions"),
    ],
)
def test_names_that_tell_no_time_are_counters(names):
    assert stamps_from_names(names) is None


def test_scans_with_stamps_come_in_the_order_of_time(tmp_path):
    # written without padding: in natural order .25 would follow .3
    names, _, stamps = list_scans(touch(tmp_path, "10.2.bin", "10.3.bin", "10.25.bin", "9.9.bin"))
    assert names == ["9.9.bin", "10.2.bin", "10.25.bin", "10.3.bin"]
    np.testing.assert_allclose(stamps, [9.9, 10.2, 10.25, 10.3])


def test_a_folder_of_a_scans_number_is_told_not_left_out(tmp_path):
    touch(tmp_path, "0.bin", "2.bin")
    (tmp_path / "1.bin").mkdir()
    with pytest.raises(InputError, match=r"1\.bin is a folder among scans"):
        list_scans(tmp_path)
    (tmp_path / "1.bin").rename(tmp_path / "maps.ply")
    assert list_scans(tmp_path)[0] == ["0.bin", "2.bin"]


def test_a_link_to_itself_is_told_by_its_name(tmp_path):
    (touch(tmp_path, "0.bin") / "1.bin").symlink_to("1.bin")
    with pytest.raises(InputError, match=r"1\.bin cannot be read"):
        list_scans(tmp_path)


def test_nanoseconds_that_were_joined_to_seconds_without_zeros_are_no_decimals(tmp_path):
    nanoseconds = [1_700_000_000 * 10**9 + 10**8 * i + 5_000_000 for i in range(20)]
    written = [f"{t // 10**9}.{t % 10**9}.pcd" for t in nanoseconds]  # 1700000000.5000000 is .005
    names, _, stamps = list_scans(touch(tmp_path, *written))
    assert names == written
    np.testing.assert_allclose(np.diff(stamps), 0.1, atol=1e-6)


def test_decimals_without_their_last_zeros_stay_decimals(tmp_path):
    decimals = ["7.1", "7.2", "7.312345678", "7.4", "7.5"]
    np.testing.assert_allclose(stamps_from_names([f"{d}.pcd" for d in decimals]), [float(d) for d in decimals])
