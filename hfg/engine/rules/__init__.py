"""What the rules decide: firing, sending, releasing, activity, ending, being quiet. Plain functions that never wait.

agenda      who may move                 firing      a firing, from taking to answering
sending     what leaves a node           releasing   when that is processed
calls       of slots                     builtin_slots   those that every node has
beside      what tasks send, which are beside the firings of their node
modifiers   what activity does           activity    what follows when it changes
listening   slots that are awake only while their node is active
wiring      which edges are live         subgraphs   as wholes
lifecycle   setup, teardown, restart, disable, enable
sharing     what becomes of it when a value that is shared is changed
ending      of one node                  sources     which rest, or work for nobody
rings       queues that grow where nodes wait for each other (F8)
quiet       what happens when nothing moves          errors  what becomes of failures
iterating   when what iterates lets the next element in (G4)
"""

__all__: list[str] = []
