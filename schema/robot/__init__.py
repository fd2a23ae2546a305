"""A robot and its genome as data."""
