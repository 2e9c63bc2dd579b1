"""Translation of Python components to C, and comparison of the result with Python to the last bit.

A component's class is read with its constants and state, evaluated as far as its values are known, lowered to
a few plain statements and written as C. What Python code may hold is a table; anything else is refused with
file and line and runs in Python. Every translation is compared with the component before it is used.
"""
