"""Simulation and evaluation of robots.

Everything but `service` and `__main__` is a pure function of its arguments.
"""
