"""State machines of off-line islands and of migration; events of all islands."""
