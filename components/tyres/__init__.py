"""Tyres: from slip and load to forces and moments at the contact point."""
