"""The experiment document: its sections, how it is read and what is checked."""
