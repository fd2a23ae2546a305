"""Arrow tables of a run: their columns, and where their files lie."""
