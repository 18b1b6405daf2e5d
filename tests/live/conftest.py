"""Packets that every test of this folder may use."""

import pytest
from room_packets import room_packets


@pytest.fixture(scope="session")
def packets() -> list[tuple[float, bytes]]:
    return room_packets()
