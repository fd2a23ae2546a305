"""Pure operators: generation, selection, crossover, mutation, random streams."""
