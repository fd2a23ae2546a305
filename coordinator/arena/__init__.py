"""State machine of an on-line island: births, deaths, orders and migration."""
