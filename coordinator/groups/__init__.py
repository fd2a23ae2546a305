"""Exchange of migrants between groups of islands, which several coordinators run."""
