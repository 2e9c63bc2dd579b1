"""The co-simulation master: creates, initializes and steps the instances of a plan.

`simulate` runs a plan, in this process or in a child. A communication step is a flat list of calls on two
arrays, walked in C or in Python. What goes wrong in an FMU ends the run with a sentence and what was
recorded.

Not here: how inputs are estimated within a step (`coupling_algorithms`), files of results (`results`).
"""
