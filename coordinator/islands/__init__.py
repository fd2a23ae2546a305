"""State machines of off-line islands and of migration, also between coordinators."""
