"""Commands of the coordinator, their flags and progress display."""
