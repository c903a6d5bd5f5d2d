"""A graph that is cut for processes, and run as one (rules L1 to L3, F7, R5).

model         what parts tell each other, and what they decide: never waits
running       one part at work, and what connects it with others
steering      what somebody outside does with the run, and sees of it
processes     parts in processes of this host
hosts         parts on other hosts, and agents
distribution  the whole, as the main part sees it
transports    finds them by name
"""

__all__: list[str] = []
