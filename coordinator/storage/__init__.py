"""Run folder: lock, journal, table segments, snapshots.

Whatever writes raises ``RunFolderError`` if the disk is full or failed; then old files,
segments and buffered rows stay as they were.
"""
