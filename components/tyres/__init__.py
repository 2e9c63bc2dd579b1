"""Tyres: from slip and load to forces at the contact point."""
