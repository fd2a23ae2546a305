"""Requests in, answers out; the arena shards that this worker holds."""
