"""Commands that list and check plug-ins, and the check before a run."""
