"""Messages between processes: Protobuf, and MessagePack for operators and viewers."""
