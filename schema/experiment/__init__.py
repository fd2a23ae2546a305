"""The experiment document: its sections, reading and checks."""
