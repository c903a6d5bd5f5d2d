"""A graph that is cut into processes and run as one (rules L1 to L3, F7, R5).

model         messages between parts, and decisions: never waits
running       one part in operation, and its connections to others
steering      control and observation of the run from outside
processes     parts in processes of this host
hosts         parts on other hosts, and agents
distribution  the whole run, as seen from the main part
transports    finds transports by name
"""

__all__: list[str] = []
