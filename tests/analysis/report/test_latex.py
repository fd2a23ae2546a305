"""The comparison of experiments as LaTeX."""

import re
from typing import Any

import pyarrow as pa
import pytest

from analysis.measures.outputs import schema
from analysis.report.latex import comparison_latex


def compared(**changes: Any) -> pa.Table:  # noqa: ANN401
    row = {
        "measure": "early_drop", "a": "50%_a", "b": "b", "births": 600, "runs_a": 3,
        "runs_b": 4, "mean_a": 0.25, "mean_b": 1.5, "difference": -1.25,
        "difference_low": -2.0, "difference_high": 1.23456e-7, "p": 0.03, "q": 0.06,
    } | changes  # fmt: skip
    return pa.Table.from_pylist([row], schema("comparison"))


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        (
            {},
            r"early drop & $0.25$ & $1.5$ & $-1.25$ & [$-2$, $1.23 \cdot 10^{-7}$] & ",
        ),
        # As in the report: no interval of one run.
        (
            {"runs_b": 1},
            r"early drop & $0.25$ & $1.5$ & $-1.25$ & -- & $0.03$ & $0.06$",
        ),
        ({"measure": "a\\b~c"}, r"a\textbackslash{}b\~{}c & $0.25$"),
        ({"mean_a": 1234567.0}, r"early drop & $1.23 \cdot 10^{6}$ & "),
    ],
)
def test_a_row_has_means_interval_p_and_q(changes: dict[str, Any], line: str) -> None:
    text = comparison_latex(compared(**changes))
    assert line in text
    assert r"measure & 50\%\_a (3) & b (" in text
    assert "% at 600 births" in text


def test_pairs_have_a_tabular_each_and_equal_measures_no_row() -> None:
    rows = [compared(), compared(measure="parts", p=None), compared(b="c")]
    text = comparison_latex(pa.concat_tables(rows))
    assert text.count(r"\begin{tabular}") == text.count(r"\end{tabular}") == 2
    assert "parts" not in text
    body = [line for line in text.splitlines() if line.endswith(r"\\")]
    assert len(body) == 4
    assert {len(re.findall(r"(?<!\\)&", line)) for line in body} == {6}
