"""Tables into measures, figures and pictures to look at.

Reads what a run left behind; never talks to one that decides.
"""
