"""Parts on other hosts.

realm     agents and runs: how they are found, and what one asks them
agent     begins parts on its host
hosting   the processes it does that with, and what these write
abroad    launching by agents
standing  a run that others hear of and steer
"""

__all__: list[str] = []
