"""Text of docs/reference/messages.md: keys and messages between processes."""

import inspect
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from google.protobuf.descriptor_pb2 import (
    DescriptorProto,
    FieldDescriptorProto,
    FileDescriptorProto,
    FileDescriptorSet,
)
from msgspec import Struct

import schema.wire.arena
import schema.wire.messages
import schema.wire.operator
import schema.wire.status
import schema.wire.updates
from docs.struct_tables import attributes, introduction, rows
from schema.agent import topics
from schema.agent.topics import KEYS, FleetMember, Role
from schema.experiment.identity import Origin
from schema.robot.results import Evaluation, Report
from schema.wire.codec import Message

_TOP = Path(__file__).parents[1]
_PROTO = "schema/wire/revolve.proto"
_HEAD = f"""# Messages and keys

Written from the code by `python -m docs.reference_pages`.
[Architecture](../architecture.md) shows the path of a birth through these messages.

Processes exchange messages of MessagePack by Zenoh through a hub; they must be of one
version. Robot files and tables hold robots and genomes as Protobuf
([{_PROTO}](../../{_PROTO})), which later versions read. Lengths
are in metres, masses in kilograms, times in seconds and angles in radians unless stated
otherwise.

"""
_MODULES = (
    schema.wire.messages,
    schema.wire.arena,
    schema.wire.operator,
    schema.wire.status,
    schema.wire.updates,
)
_OTHERS = (Report, Evaluation, Origin)
"""Structs in messages that are also used elsewhere."""
_CODING = """Maps with the names of the fields. A message that may stand where others
may has a field `type` that names it. Fields with a default may be missing; other fields
are refused. A `BirthId` is a list of two whole numbers from 0: the island of birth and
the number there. A `Robot` is a list of its parts and its brain, a `Brain` a list of
its neurons and its connections; a `Part`, a `Neuron` and a `Connection` are lists of
the fields of the [Protobuf messages](#protobuf-messages) of that name, the layer as
`input`, `output` or `hidden`."""
_ROLES: tuple[Role, ...] = ("coordinator", "worker", "analyzer")
_OF_ROLE: dict[str, tuple[Role, ...]] = {
    "jobs": ("worker", "analyzer"),
    "cancelled": ("worker", "analyzer"),
    "info": ("worker", "analyzer"),
    "command": ("coordinator",),
    "state": ("coordinator",),
    "events": ("coordinator",),
    "poses": ("worker",),
}
"""Processes that have a key; all have the others."""


def page() -> str:
    """Return the page."""
    parts = (_keys(), _messagepack(), _protobuf())
    return _HEAD + "\n".join(line for part in parts for line in part).rstrip() + "\n"


def key_names() -> list[str]:
    """Return the names of the keys that a process may have."""
    return [*KEYS, "poses"]


def _keys() -> Iterator[str]:
    """Yield the table of the keys."""
    yield "## Keys\n"
    yield f"{introduction(topics).partition(chr(10))[2].strip()}\n"
    yield "| key | of | meaning |"
    yield "|---|---|---|"
    for name in key_names():
        for role in _OF_ROLE.get(name, _ROLES):
            member = FleetMember("FLEET", role, "NAME")
            found = getattr(member, name)
            key = found if isinstance(found, str) else _with_shard(found)
            yield f"| `{key}` | {role} | {_key_meaning(name)} |"
    yield ""


def _with_shard(poses: Any) -> str:  # noqa: ANN401 - a method of one number
    return str(poses(0)).replace("/0/", "/SHARD/")


def _key_meaning(name: str) -> str:
    text = attributes(FleetMember).get(name) or introduction(getattr(FleetMember, name))
    return re.sub("^[Kk]ey (that )?", "", text).removesuffix(".")


def described_proto() -> FileDescriptorProto:
    """Return the Protobuf file with the comments of its source."""
    with TemporaryDirectory() as folder:
        out = Path(folder) / "revolve.bin"
        words = (
            f"-I{_TOP}",
            "--include_source_info",
            f"--descriptor_set_out={out}",
            _PROTO,
        )
        subprocess.run(
            (sys.executable, "-m", "grpc_tools.protoc", *words), cwd=_TOP, check=True
        )
        return FileDescriptorSet.FromString(out.read_bytes()).file[0]


def _protobuf() -> Iterator[str]:
    """Yield the tables of the Protobuf messages."""
    file = described_proto()
    comments = {
        tuple(each.path): " ".join(
            f"{each.leading_comments} {each.trailing_comments}".split()
        )
        for each in file.source_code_info.location
    }
    yield "## Protobuf messages\n"
    yield "A number, once given to a field, is never used for another one.\n"
    for index, message in enumerate(file.message_type):
        about = comments.get((4, index), "")
        if not about:
            raise ValueError(f"{message.name}: has no comment")
        yield f"### `{message.name}`\n"
        yield f"{_text(about)}\n"
        if message.field:
            yield "| number | field | type | meaning |"
            yield "|---|---|---|---|"
        for place, field in enumerate(message.field):
            meaning = comments.get((4, index, 2, place), "")
            if not meaning:
                raise ValueError(f"{message.name}.{field.name}: has no comment")
            kind = _field_type(field, message)
            yield f"| {field.number} | `{field.name}` | {kind} | {_text(meaning)} |"
        yield ""
    for index, enum in enumerate(file.enum_type):
        yield f"### `{enum.name}`\n"
        yield f"{_text(comments[5, index])}\n"
        yield "| number | value |"
        yield "|---|---|"
        for value in enum.value:
            yield f"| {value.number} | `{value.name}` |"
        yield ""


def _field_type(field: FieldDescriptorProto, message: DescriptorProto) -> str:
    """Return the type of a field as the source has it."""
    name = field.type_name.rpartition(".")[2]
    kind = FieldDescriptorProto.Type.Name(field.type).removeprefix("TYPE_").lower()
    shown = f"[`{name}`](#{name.lower()})" if name else kind
    if field.proto3_optional:
        return f"optional {shown}"
    if field.HasField("oneof_index"):
        return f"{shown}, one of `{message.oneof_decl[field.oneof_index].name}`"
    is_list = field.label == FieldDescriptorProto.LABEL_REPEATED
    return f"list of {shown}" if is_list else shown


def _text(comment: str) -> str:
    return comment.replace("|", "\\|")


def messagepack() -> dict[str, type[Struct]]:
    """Return the MessagePack messages by name."""
    messages: dict[str, type[Struct]] = {
        name: found
        for module in _MODULES
        for name, found in vars(module).items()
        if inspect.isclass(found)
        and issubclass(found, Message)
        and found.__module__ == module.__name__
    }
    return messages | {each.__name__: each for each in _OTHERS}


def _messagepack() -> Iterator[str]:
    """Yield the tables of the MessagePack messages."""
    yield "## MessagePack messages\n"
    yield f"{_CODING}\n"
    messages = messagepack()

    def link(inner: type) -> str:
        name = inner.__name__
        return f"[`{name}`](#{name.lower()})" if name in messages else f"`{name}`"

    for name, found in messages.items():
        yield f"### `{name}`\n"
        yield f"{introduction(found)}\n"
        config = found.__struct_config__
        if config.tag:
            yield f"Its `type` is `{config.tag}`.\n"
        if config.array_like:
            yield "A list of the fields, in this order.\n"
        if found.__struct_fields__:
            yield from rows(found, link)
