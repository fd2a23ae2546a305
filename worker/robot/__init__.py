"""One robot: controller, sensors, motors, noise, off-line evaluation."""
