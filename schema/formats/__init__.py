"""Robot files: YAML, RoboGen, MJCF and URDF."""
