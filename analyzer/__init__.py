"""Analyzer: can a body be built, how large is it, do its parts intersect?

All but `service` and `__main__` is a pure function of its arguments.
"""
