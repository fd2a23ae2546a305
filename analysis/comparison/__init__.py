"""Measures of many runs into statistics and findings."""
