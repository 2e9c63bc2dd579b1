"""Matplotlib figures of runs in the style of the papers, and how signals and numbers are shown.

Not here: figures of studies, rankings or fits, which stand beside what they draw; curves on pages
(`reports`).
"""
