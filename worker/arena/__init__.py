"""The on-line world: clock, insertions, batched control, snapshots."""
