"""Limits of what comes from outside: files of other people, and messages.

A document is measured before it is parsed, so that a hostile one costs little.
"""

MOST_TEXT_BYTES = 1_000_000
"""Size of a robot file, an experiment or scenery."""
MOST_SETTINGS_BYTES = 4_000_000
"""Size of the settings in a request: they hold the scenery of an island as JSON."""
MOST_NODES = 100_000
"""Values in a YAML document, elements in an XML one."""
MOST_DEPTH = 400
"""Levels of nesting in YAML and XML."""
MOST_KEY_PARTS = 16
"""Parts of a dotted key in TOML; ``tomllib`` takes quadratic memory for them."""
MOST_GEOMS = 10_000
"""Geoms of scenery, replicated ones included."""
MOST_PLUGIN_CHARACTERS = 10_000
"""Length of the list of plug-ins and digests in a request."""
MOST_SHOWN = 80
"""Characters of a foreign text in a message to the user."""
