"""Pure machine of an on-line island."""
