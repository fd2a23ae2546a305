"""Protobuf messages that two processes exchange, and their codecs."""
