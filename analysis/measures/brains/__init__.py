"""Measures of brains: change from parent to child, recurrence, use of sensors."""
