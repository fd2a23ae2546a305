"""Plug-ins: which modules may be imported, loading by name, checks, parameters."""
