"""The tables of docs/equal_evaluations.csv: in their pages, and by hand."""

from docs.equal_evaluations import CHANGES, compared, winners, write_pages


def row(experiment: str, mean: float, alone: float, under: float) -> dict[str, str]:
    numbers = {"mean": mean, "best": alone, "without changes": alone}
    found = {"experiment": experiment, "births": "150"}
    for name, value in (numbers | dict.fromkeys(CHANGES, under)).items():
        found[name] = f"{value}"
    return found


ROWS = [
    row("robust", 0.1, 0.2, 0.19),
    row("robust", 0.3, 0.4, 0.40),
    row("robust", 0.2, 0.3, 0.15),
    row("scenario1", 0.4, 0.6, 0.30),
    row("scenario1", 0.5, 0.6, 0.30),
    row("scenario1", 0.6, 0.6, 0.30),
]


def test_tables_of_the_pages_are_those_of_the_rows() -> None:
    assert write_pages(is_check=True) == 0, "run python -m docs.equal_evaluations page"


def test_difference_by_hand() -> None:
    # Student's t with 4 degrees of freedom: 2.776 * 0.1 * sqrt(2 / 3) = 0.2267.
    # Rank sums: one of 20 ways is as extreme, on each side; ties change nothing.
    *_, difference = compared("robust", ROWS)
    assert "-0.3000 (-0.5267 to -0.0733), p = 0.1" in difference


def test_shares_of_winners_by_hand() -> None:
    *_, robust, base = winners("robust", ROWS)
    assert robust == "| `robust` | 3 | 0.3000 | 0.1900 | 95 % (50 to 100 %) |"
    assert base == "| `scenario1` | 3 | 0.6000 | 0.3000 | 50 % (50 to 50 %) |"
