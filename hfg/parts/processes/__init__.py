"""Parts in processes of this host.

worker     a part that somebody else has begun
process    the process around it
launching  where parts are begun
other      what the main part knows of another
"""

__all__: list[str] = []
