"""Diversity: distances of bodies, cells of a grid, fronts of several objectives."""
