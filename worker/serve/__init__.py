"""Handling of requests: evaluations and advances of arena shards."""
