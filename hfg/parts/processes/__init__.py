"""Parts in processes of this host.

worker        a part that another process has started
process       the process around it
standby       a process that has imported hfg and waits
launching     starts parts
rendezvous    the folder of their sockets
peer_process  the main part's state of another part
"""

__all__: list[str] = []
