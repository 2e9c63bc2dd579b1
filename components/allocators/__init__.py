"""Allocators: from yaw moment to longitudinal force requests of the four wheels."""
