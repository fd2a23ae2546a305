"""Command ``revolve doctor``: what a machine lacks for runs, and what to do."""
