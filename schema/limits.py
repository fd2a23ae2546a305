"""Limits of everything that comes from another process or from another's file.

Every decoder uses these. The length of a message is checked before it is parsed, the
number of its submessages before they are made, and texts are cut. What a request or
the state of an arena limits further is checked by ``coordinator.run``.
"""

import sys
from typing import Annotated

from msgspec import Meta

KIB = 1024
MIB = 1024 * KIB

# Texts in characters

MOST_SHOWN = 80
"""Names and other foreign texts in a message to the user."""
LONGEST_REASON = 1000
"""Reasons of failures, refusals and deaths; longer ones are cut."""
LONGEST_NAME = 1000
"""Names and identifiers in messages of MessagePack; longer ones are refused."""

# Messages in bytes

ROBOT_BYTES = 1 * MIB
"""A robot, a body or a genome."""
REQUEST_BYTES = 16 * MIB
"""A request about one robot; its settings may contain a scenery."""
ADVANCE_REQUEST_BYTES = 256 * MIB
"""A request about an arena; it may contain a snapshot and a history."""
ANSWER_BYTES = 16 * KIB
"""An answer about one robot."""
BRED_BYTES = 4 * MIB
"""An answer about a birth: reasons of failed attempts, a genome and a robot."""
TRACE_BYTES = 256 * MIB
"""An answer with the trace of a robot."""
VALUE_BYTES = 1 * MIB
"""The argument or the value of a call of a user's function."""
ADVANCE_BYTES = 256 * MIB
"""An answer about an arena, of any arena."""
BUNDLE_BYTES = 257 * MIB
"""Requests to an agent, or answers, that travel together."""
MOST_BUNDLED = 16
"""Jobs that travel together."""
INFO_BYTES = 128 * KIB
"""An agent's description of itself, with its predecessors' deaths."""
LIVE_BYTES = 64 * MIB
"""A message to viewers about an arena."""
UPDATE_BYTES = 64 * MIB
"""A message to viewers about a run, or its state, which travels in pages."""
PAGE_BYTES = 32 * KIB
"""A page of a run's state; with its numbers, less than a connection sends at once."""
MIGRANTS_REQUEST_BYTES = 1 * MIB
"""A request of a coordinator for migrants from islands of another one."""
MIGRANTS_BYTES = 64 * MIB
"""The reply to it; what does not fit is in the next one."""
OPERATOR_REQUEST_BYTES = 2 * MIB
"""A request of an operator; it may contain a robot."""
OPERATOR_REPLY_BYTES = 16 * MIB
"""The reply to an operator."""

# Counts

MOST_PARTS = 1000
MOST_PAIRS = MOST_PARTS * (MOST_PARTS - 1) // 2
MOST_NEURONS = 10_000
MOST_CONNECTIONS = 50_000
"""Parts, neurons and connections of a robot, or of a genome."""
MOST_NEURON_PARAMETERS = 32
"""Evolving parameters of a neuron."""
MOST_NEURON_STATES = 16
"""State variables of a neuron."""
MOST_LIVING = 100_000
MOST_PATCHES = 1000
"""Living robots of an arena."""
MOST_TOUCHES = 500_000
"""Pairs of robots that touch in one advance."""
MOST_MEASURES = 100
"""Measures of an experiment; an answer has the number of each."""
MOST_TRIAL = 1_000_000
"""Greatest number of a robot's evaluation that a user may name."""
MOST_PIXELS = 4096
"""Width or height of a picture of a robot."""

# Agents and what they say

MOST_SEED = 2**64 - 1
"""Greatest random seed: messages and tables hold it in 64 bits."""
MOST_EPOCH = 2**32
"""Greatest epoch: a run is never resumed more often."""
MOST_RUN_NAME = 5000
"""Characters of a run's name: host, nonce and absolute path."""
MOST_PEERS = 20
"""Peers that are named for each kind of fault; the others are counted together."""
MOST_MEMBERS = 10_000
"""Agents whose tokens a coordinator keeps; a hub has no more connections."""
MOST_ASKED_INFOS = 1000
"""Open queries of a coordinator for properties of agents."""
MOST_QUERIES = 1000
"""Queries of operators, and of viewers, that wait for a coordinator's reply."""
MOST_QUERY_BYTES = 64 * MIB
"""Bytes of such queries, together."""
MOST_WAITING_BYTES = 512 * MIB
"""Bytes of jobs that wait for an agent, together."""
WAITING_JOB_BYTES = 64 * KIB
"""What each of them counts in addition, so that their number has a limit, too."""
MOST_SLOTS = 1024
"""Jobs that an agent does at a time."""
MOST_PLATFORM = 300
"""Characters of a platform tag."""
MOST_DEATHS = 8
"""Crashed predecessors that an agent reports."""
MOST_SHARDS = 10_000
MOST_CORES = 4096
"""Arenas that an agent keeps, and cores that it uses for one."""
LONGEST_QUIET_S = 5.0
"""A job that used CPU time within this time makes progress [s]."""

# Small files of a run folder

MOST_DESCRIPTION = 1 << 24
"""Bytes of ``run.json`` or ``campaign.toml``, which hold experiments with scenery."""
MOST_FOUNDER_BYTES = 8 * MIB
"""Genomes of given founders, which ``run.json`` and ``campaign.toml`` hold."""
MOST_MARK = 1000
"""Bytes of the files ``state`` and ``epoch``."""
MOST_NAME = 1000
"""Characters of the name of an experiment in ``run.json``."""
MOST_REPEATS = 100_000
"""Repeats of a campaign."""

# Documents: robot files, experiments, sceneries; measured before they are parsed

MOST_TEXT_BYTES = 1_000_000
"""Size of a robot file, an experiment or scenery."""
MOST_MJCF_BYTES = 6_000_000
"""Size of a robot file in MJCF, which may hold rough ground as text."""
MOST_SETTINGS_BYTES = 4_000_000
"""Size of the settings in a request: they hold the scenery of an island as JSON."""
MOST_NODES = 100_000
"""Values in a YAML document."""
MOST_XML_TAGS = 50_000
"""Tags of an XML document: one or two for each element."""
MOST_XML_ATTRIBUTES = 200_000
"""Attributes in an XML document."""
MOST_DEPTH = 400
"""Levels of nesting in YAML and XML."""
MOST_BRACKETS = 20_000
"""Opening square brackets, of tables and lists, in TOML."""
MOST_DIGITS = 1000
"""Digits of a number in TOML."""
MOST_KEY_PARTS = 16
"""Parts of a dotted key in TOML; ``tomllib`` takes quadratic memory for them."""
MOST_ISLANDS = 10_000
"""Islands of an experiment."""
MOST_SWEEP_POINTS = 1000
"""Experiments of a sweep."""
MOST_ISLAND_TABLES = 1000
"""Tables ``[[islands]]`` of an experiment."""
MOST_OTHERS = 100
"""Elements of MJCF that belong to no part, of a kind: default classes, lights."""
MOST_SCENERY_DEPTH = 100
"""Levels of nesting in scenery; MuJoCo takes quadratic time for them."""
MOST_LINE = 1000
"""Characters of a line in RoboGen's text."""
MOST_COUNT = 2**63 - 1
"""Greatest whole number in an experiment."""
MOST_NUMBER = 2**32 - 1
"""Greatest number of an island, of a birth in flags, or of a robot of a seed."""
MOST_GEOMS = 10_000
"""Geoms of scenery, replicated ones included."""
MOST_OBJECTS = 100
"""Objects of scenery that move, replicated ones included."""
MOST_PLUGIN_BYTES = 4 * MIB
"""Source of a plug-in file, which a run folder keeps."""
MOST_PACKED_BYTES = 8 * MIB
MOST_PACKED_MEMBERS = 2000
"""Size of a packed robot, and files in it, its picture and plug-ins included."""
MOST_PLUGIN_CHARACTERS = 10_000
"""Length of the list of plug-ins and digests in a request."""

# Numbers

Finite = Annotated[float, Meta(ge=-sys.float_info.max, le=sys.float_info.max)]
"""Float that is neither infinite nor NaN: NaN satisfies no bound."""
PositiveFinite = Annotated[float, Meta(gt=0, le=sys.float_info.max)]
MOST_LENGTH_M = 1e6
"""Greatest length in an experiment [m]: beyond it contacts lose their precision."""
GREATEST_COORDINATE = 1e10
"""Coordinate above which the physics engine resets its state [m]."""
LONGEST_WALL_S = 1e9
"""Duration of a job by the clock [s]."""


def printable_line(text: str) -> str:
    """Return a text as one line of its length: control characters become spaces."""
    return "".join(c if c.isprintable() else " " for c in text)


def printable_lines(text: str) -> str:
    """Return a text with ``?`` in place of control characters other than line ends."""
    return "".join(c if c.isprintable() or c == "\n" else "?" for c in text)


def printable(text: str, most: int = MOST_SHOWN) -> str:
    """Return a text as one line of at most so many characters.

    Each run of white space becomes a space; a character that is not printable becomes
    ``?``, so that no text can move a terminal's cursor or reverse its direction. A text
    that is cut ends in ``...``.
    """
    if len(text) <= most and text.isprintable() and "  " not in text:
        return text.strip()
    # White space may fill a text: what is split is bounded first.
    words = text[: 4 * most].split()
    line = "".join(c if c.isprintable() else "?" for c in " ".join(words))
    if len(line) <= most and len(text) <= 4 * most:
        return line
    return f"{line[: most - 3]}..."
