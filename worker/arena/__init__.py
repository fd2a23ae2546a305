"""The on-line world: time, insertions, batched control, records, snapshots."""
