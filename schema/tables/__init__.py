"""Arrow tables of a run: columns and files."""
