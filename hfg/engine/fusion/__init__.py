"""Fast paths: what the rules prescribe for the common shapes, as fewer steps.

members, schedule   which nodes may be fused, and in which order they fire
facts, firing_text, writing, tap_writing   the text of a wave, one generated function; binding: compiles it
wave_state, turns, exits, region    a region: between its waves, within a wave, on the way out of it, as a whole
giving_way, threads   regions with async members, and regions of a thread group
slots, waiting      calls of slots, and async functions that really wait
specialise          chooses one of them for a node, or the interpreted way

Only here are fields of `RunningNode` written from outside of it. A fast path is the node's transitions (`begin_call`,
`make_fireable`, `end_firing` ...) written out, several of them in one go and without those whose outcome is known; a
call of each would cost what is saved. That the outcome is the same is not for the eye to see: `check_invariants` asks
for it after every step in the tests of the semantics and in debug mode, and the oracle must give the same traces.
"""

__all__: list[str] = []
