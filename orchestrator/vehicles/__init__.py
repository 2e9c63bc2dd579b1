"""Cars on a test track: handling figures of a vehicle file with its plant and tyres."""
