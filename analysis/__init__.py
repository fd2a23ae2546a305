"""Tables to measures, figures and pictures, and the viewer.

Reads run folders and messages of live runs; never influences a run.
"""
