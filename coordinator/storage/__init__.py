"""Run folder: lock, journal, table segments, snapshots."""
