"""Parts in processes of this host.

worker     a part that another process has started
process    the process around it
spares     a process that has imported hfg and waits
launching  starts parts
meeting    the folder of their sockets
other      the main part's state of another part
"""

__all__: list[str] = []
