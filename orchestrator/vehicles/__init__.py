"""Cars by themselves: a vehicle file driven on its plant and tyres, and what that tells of it."""
