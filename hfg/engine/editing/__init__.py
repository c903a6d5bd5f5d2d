"""Changes of a running graph, and means to hold it: edits, pause, steps, breakpoints.

edits        one edit after the other      turns     who edits now       holding   nodes at rest meanwhile
plan_index   where everything is in a plan
plan_diff    what an edit means to it      applying  does that
pausing      pause, steps, breakpoints (rule R3)
"""

__all__: list[str] = []
