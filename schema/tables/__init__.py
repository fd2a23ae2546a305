"""Files of a run: Arrow tables, description; how a file is replaced."""
