"""Analyzer: can a body be built, how large is it, do its parts intersect?

Its processes breed, too, with a function that their command hands to them.

All but `service` and `__main__` is a pure function of its arguments.
"""
