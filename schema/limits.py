"""Limits of what comes from outside: files of other people, and messages.

A document is measured before it is parsed, so that a hostile one costs little.
"""

MOST_TEXT_BYTES = 1_000_000
"""Size of a robot file, an experiment or scenery."""
MOST_MJCF_BYTES = 6_000_000
"""Size of a robot file in MJCF, which may hold rough ground as text."""
MOST_SETTINGS_BYTES = 4_000_000
"""Size of the settings in a request: they hold the scenery of an island as JSON."""
MOST_NODES = 100_000
"""Values in a YAML document, elements in an XML one."""
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
MOST_PARTS = 1000
"""Parts of a robot in a file."""
MOST_ISLANDS = 10_000
"""Islands of an experiment."""
MOST_ISLAND_TABLES = 1000
"""Tables ``[[islands]]`` of an experiment."""
MOST_NEURONS = 10_000
"""Neurons of a robot in a file."""
MOST_OTHERS = 100
"""Elements of MJCF that belong to no part, of a kind: default classes, lights."""
MOST_SCENERY_DEPTH = 100
"""Levels of nesting in scenery; MuJoCo takes quadratic time for them."""
MOST_LINE = 1000
"""Characters of a line in RoboGen's text."""
MOST_COUNT = 2**63 - 1
"""Greatest whole number in an experiment."""
MOST_GEOMS = 10_000
"""Geoms of scenery, replicated ones included."""
MOST_PLUGIN_CHARACTERS = 10_000
"""Length of the list of plug-ins and digests in a request."""
MOST_SHOWN = 80
"""Characters of a foreign text in a message to the user."""
