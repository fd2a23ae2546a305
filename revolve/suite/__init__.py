"""Suite: a frozen protocol of tasks, seeds and births, and scores of experiments."""
