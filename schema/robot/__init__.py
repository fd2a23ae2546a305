"""Robots and genomes as data."""
