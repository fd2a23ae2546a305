"""Rerun viewer, live and replay."""
