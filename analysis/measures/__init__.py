"""Tables of a run into measures."""
