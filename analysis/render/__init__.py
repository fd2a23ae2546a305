"""A robot as a picture."""
