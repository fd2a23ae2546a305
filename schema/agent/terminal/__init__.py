"""What a terminal shows of commands."""
