"""Allocators: from yaw moment to four longitudinal force requests."""
