"""Self-contained HTML pages made from results: studies, comparisons, evaluations, the viewer of runs.

A page is a typed view given to a template. Pages of wings stand with their wing and use the parts of this
room.
"""
