"""References: yaw rate and sideslip desired by the driver."""
