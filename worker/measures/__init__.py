"""Measures: numbers of a robot's life that are recorded beside its fitness."""
