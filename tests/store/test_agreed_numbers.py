from tests.helpers.agreed import changed_numbers


def test_the_numbers_of_this_package_are_those_that_were_agreed() -> None:
    assert changed_numbers("shm.store") == {}
