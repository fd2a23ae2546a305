"""Random messages of any type, drawn within the limits of its fields."""

from typing import Any

import msgspec.inspect as kinds
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

_GREATEST = 2**64 - 1
"""Of MessagePack."""
_MOST_ITEMS = 2


def messages_of(*types: Any) -> SearchStrategy[Any]:  # noqa: ANN401 - also unions
    """Return a strategy of the messages of some types or unions."""
    return st.one_of([_drawn(kinds.type_info(each)) for each in types])


def _drawn(kind: kinds.Type) -> SearchStrategy[Any]:
    match kind:
        case kinds.StructType() | kinds.NamedTupleType():
            fields = {field.name: _drawn(field.type) for field in kind.fields}
            return st.builds(kind.cls, **fields)
        case kinds.UnionType():
            return st.one_of(list(map(_drawn, kind.types)))
        case kinds.TupleType():
            return st.tuples(*map(_drawn, kind.item_types))
        case kinds.VarTupleType():
            return st.lists(_drawn(kind.item_type), max_size=_MOST_ITEMS).map(tuple)
        case kinds.DictType():
            entries = _drawn(kind.key_type), _drawn(kind.value_type)
            return st.dictionaries(*entries, max_size=_MOST_ITEMS)
    return _drawn_value(kind)


def _drawn_value(kind: kinds.Type) -> SearchStrategy[Any]:
    match kind:
        case kinds.LiteralType():
            return st.sampled_from(kind.values)
        case kinds.IntType():
            least = -(2**63) if kind.ge is None else kind.ge
            return st.integers(least, _GREATEST if kind.le is None else kind.le)
        case kinds.FloatType():
            return st.floats(kind.ge, kind.le, allow_nan=False, allow_infinity=False)
        case kinds.StrType():
            return st.text(min_size=kind.min_length or 0, max_size=8)
        case kinds.BytesType():
            least = kind.min_length or 0
            return st.binary(min_size=least, max_size=max(least, 8))
    return {kinds.BoolType: st.booleans(), kinds.NoneType: st.none()}[type(kind)]
