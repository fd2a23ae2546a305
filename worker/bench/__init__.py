"""The command `revolve bench`."""
