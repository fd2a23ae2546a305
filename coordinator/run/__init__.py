"""Drives one run or many: events in, journal first, commands out."""
