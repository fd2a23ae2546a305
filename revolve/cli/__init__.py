"""What the command `revolve` has besides commands: versions, parsers, completion."""
