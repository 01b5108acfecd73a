"""Fixtures that several tests of the link use."""

import pytest

from tests.unit.link.scripted_vehicle import Vehicle


@pytest.fixture
def vehicle() -> Vehicle:
    return Vehicle()
