"""Parts in processes of this host.

worker     a part that somebody else has begun
process    the process around it
spares     a process that has imported hfg and waits
launching  where parts are begun
meeting    the folder in which they meet
other      what the main part knows of another
"""

__all__: list[str] = []
