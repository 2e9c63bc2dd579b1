"""Roads: what lies under the wheels, and what blows from the side."""
