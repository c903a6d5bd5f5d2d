"""Where the code of nodes is executed, and by which clock: the first wing that waits.

code        runs node code: on the loop, by an eager task (async), in the thread of one of the groups
eager_task     the dormant task of an async node           groups      who of a group is next; their threads
tasks       what nodes start beside their firings        lost        what they start by asyncio, and nobody looks after
virtual     a loop whose clock jumps                    punctual    a loop whose timers ring in time
watchdog    a node that blocks the loop
"""

__all__: list[str] = []
