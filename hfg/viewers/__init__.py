"""Live viewers of a run: other programs see while it happens what a recording would contain.

The modules, each on those above it:

  protocol      messages of Foxglove's WebSocket protocol, as far as a server that only shows needs them
  channels      ports, events, activity and the log, each observed only while a viewer has subscribed
  looking       viewers, their subscriptions, and a bounded queue of messages for each
  foxglove      the server, on a thread of its own
"""

__all__: list[str] = []
