"""What the tests of whole refinements share: the ray-cast room, and one photo of it."""

import pytest
from boxroom import LENS, TRUTH, BoxRoom


@pytest.fixture(scope="module")
def room():
    return BoxRoom()


@pytest.fixture(scope="module")
def photo(room):
    return room.photo(LENS, TRUTH)
