from pathlib import Path

import pytest

from automos.core.errors import InputError
from automos.readers.formats import choose_sensor, split_sensor

DRIVE = Path("logs/drive.pcap")


def test_a_sensor_is_named_below_its_file(tmp_path):
    file = tmp_path / "drive.pcap"
    file.touch()
    assert split_sensor(file) == (file, None)
    assert split_sensor(file / "7") == (file, "7")


@pytest.mark.parametrize(("wanted", "sensors"), [(None, ["7"]), ("7", ["7"]), ("7", ["5", "7"])])
def test_the_sensor_that_is_wanted_is_chosen_else_the_only_one(wanted, sensors):
    assert choose_sensor(DRIVE, wanted, sensors, "sensor") == "7"


def test_of_several_sensors_none_is_chosen_unasked():
    with pytest.raises(InputError, match=r"^logs/drive.pcap has 2 Ousters \(5, 7\); give one, as logs/drive.pcap/5$"):
        choose_sensor(DRIVE, None, ["5", "7"], "Ouster")


def test_a_sensor_that_is_not_there_is_told_with_those_that_are():
    with pytest.raises(InputError, match=r"^logs/drive.pcap has no Ouster 6; it has: 5, 7$"):
        choose_sensor(DRIVE, "6", ["5", "7"], "Ouster")
