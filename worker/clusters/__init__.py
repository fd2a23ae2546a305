"""Robots that share one engine model: merging, splitting, proximity."""
