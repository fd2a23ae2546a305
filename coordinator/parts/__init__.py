"""One arena over several workers: parts of its robots, exchanges, their results."""
