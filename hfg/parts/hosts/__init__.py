"""Parts on other hosts.

realm         agents and runs, and how to find them
requests      requests to them
agent         starts parts on its host
hosting       the processes that it uses for this, and their output
remote_parts  launching by agents
supervised    one part as a program of its own, for other supervisors
health        its answers to these
announcement  a run that other programs can find and control
"""

__all__: list[str] = []
