"""Plug-ins of a user of Revolve Islands, one of each kind; they import it alone."""
