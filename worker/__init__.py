"""Robot into motion, motion into a number.

Everything but `service` and `__main__` is a pure function of its arguments.
"""
