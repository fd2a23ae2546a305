"""Version of Revolve Islands; pyproject.toml takes it from here."""

VERSION = "0.3.0"
