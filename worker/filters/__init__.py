"""Filters between sensors, brains and motors: noise, calibration, ablation, pushes."""
