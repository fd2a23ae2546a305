"""Numbers in messages and tables for people."""

import pytest

from schema.errors import rounded


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (0.00023456, "0.0002346"),
        (0.1, "0.1000"),
        (-0.00102, "-0.001020"),
        (1.02e-7, "1.020e-07"),
        (0.0, "0.000"),
        (12.3456, "12.35"),
        (1234.4, "1234"),
        (9999.6, "10000"),
        (123456.7, "123457"),
    ],
)
def test_numbers_keep_four_significant_digits(value: float, expected: str) -> None:
    assert rounded(value) == expected


def test_number_of_digits_may_be_chosen() -> None:
    assert rounded(0.51234, 3) == "0.512"
