"""Parts on other hosts.

realm     agents and runs: how to find them, and requests to them
agent     starts parts on its host
hosting   the processes that it uses for this, and their output
abroad    launching by agents
standing  a run that other programs can find and control
"""

__all__: list[str] = []
