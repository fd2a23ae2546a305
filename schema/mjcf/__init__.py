"""Translation of robots and their world into MuJoCo models."""
