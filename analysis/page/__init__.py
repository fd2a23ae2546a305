"""Web pages that play recorded motion of robots, without network."""
