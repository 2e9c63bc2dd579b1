"""Roads: friction, slope and bank under the wheels, and side wind."""
