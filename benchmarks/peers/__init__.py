"""What others do with the same work: one module each, so that one that is not installed is only missing.

How each is used follows its own documentation, in the form that is fastest in this work.
"""
