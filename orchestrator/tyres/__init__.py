"""Tyres by themselves: an FMU stepped on a stand, and what it gives drawn."""
