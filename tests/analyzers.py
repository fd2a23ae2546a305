"""Analyzers as the commands compose them: breeder and report of two rooms."""

from functools import partial

from analyzer import service
from analyzer.report import analyze
from coordinator.evolution.newborns import breed

answer = partial(breed, vet=analyze)
"""Does the work of a request."""
process = partial(service.process, answer)
"""Runs an analyzer process."""
