import pytest

from tests.helpers.agreed import changed_numbers


@pytest.mark.parametrize("package", ["shm.values", "shm.bridge"])
def test_the_numbers_of_these_packages_are_those_that_were_agreed(package: str) -> None:
    assert changed_numbers(package) == {}
