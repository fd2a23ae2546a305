"""Encoding ``cppn``: networks that describe body and brain by patterns in space."""
