"""Main loop of runs: journals events, then carries out the islands' commands."""
