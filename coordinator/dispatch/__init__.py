"""State machines that assign jobs and arena shards to agents."""
