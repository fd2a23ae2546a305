"""Values that flags accept, and the errors of others."""

from collections.abc import Callable

import pytest

from schema.agent.flags import Flags, number, positive_number, share, whole_number


def parsed(read: Callable[[str], float], text: str) -> float:
    flags = Flags(prog="revolve try")
    flags.add_argument("--value", type=read)
    value: float = flags.parse_args([f"--value={text}"]).value
    return value


@pytest.mark.parametrize(
    ("read", "text", "value"),
    [
        (whole_number(0), "0", 0),
        (whole_number(), "17", 17),
        (whole_number(16, 99), "99", 99),
        (number, "-2.5", -2.5),
        (positive_number, "1e-3", 1e-3),
        (share, "0", 0.0),
        (share, "1", 1.0),
    ],
)
def test_what_is_allowed(read: Callable[[str], float], text: str, value: float) -> None:
    assert parsed(read, text) == value


@pytest.mark.parametrize(
    ("read", "text", "what"),
    [
        (whole_number(0), "-1", "a whole number >= 0"),
        (whole_number(), "0", "a whole number >= 1"),
        (whole_number(), "1.5", "a whole number >= 1"),
        (whole_number(), "\u00b2", "a whole number >= 1"),
        (whole_number(16), "15", "a whole number >= 16"),
        (whole_number(16, 99), "100", "a whole number in 16..99"),
        (number, "inf", "a finite number"),
        (number, "five", "a finite number"),
        (positive_number, "0", "a finite number > 0"),
        (positive_number, "nan", "a finite number > 0"),
        (share, "1.01", "a number from 0 to 1"),
        (share, "-0.01", "a number from 0 to 1"),
    ],
)
def test_what_is_not(
    capsys: pytest.CaptureFixture[str],
    read: Callable[[str], float],
    text: str,
    what: str,
) -> None:
    with pytest.raises(SystemExit) as ended:
        parsed(read, text)
    said = capsys.readouterr().err
    assert ended.value.code == 2
    line = f"revolve try: argument --value: must be {what}, got {text!r} "
    assert said.splitlines() == [line + "(see revolve try --help)"]
