"""Learners of lifetime learning, and the brain parameters that they change."""
