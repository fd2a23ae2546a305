"""The one translation of a robot into MuJoCo."""
