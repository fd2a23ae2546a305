"""Runtime that worker and analyzer processes share: connection, processes, serving."""
