"""One robot: controller, sensors, noise and its off-line evaluation."""
