"""Limits of what comes from outside: files of other people, and messages."""

MOST_SHOWN = 80
"""Characters of a foreign text in a message to the user."""
MOST_REASON = 1000
"""Characters of an agent's reason for not doing a job."""
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
MOST_SLOTS = 1024
"""Jobs that an agent does at a time."""
MOST_PLATFORM = 300
"""Characters of a platform tag."""
MOST_DEATHS = 8
"""Crashed predecessors that an agent reports."""
