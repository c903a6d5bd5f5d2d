"""Faults to be planted, each of which breaks one rule: the suite must find every one of them.

A mutant that is found by no test shows what no test looks at. They are planted in a copy, never here.
"""

from __future__ import annotations

from typing import Final, NamedTuple

__all__ = ["MUTANTS", "Mutant"]

_RULES: Final = ("tests/semantics/test_fused_rules.py",)
_SENDING: Final = ("tests/semantics/test_fused.py", "-k", "not interpreted and not beside")
_LARGE: Final = ("tests/semantics/test_fused.py", "-k", "large")
_MEDDLING: Final = ("tests/semantics/test_fused_meddling.py",)
_LOOKING: Final = ("tests/recording/test_fused.py", "-k", "not random")
_BOUNDED: Final = ("tests/links/test_bounded.py",)
_EXACT: Final = ("tests/links/test_exact.py",)
_PARTS: Final = ("tests/parts/test_distributed_runs.py",)

# The generators, which must find again what people once found.
_GRAPHS: Final = ("tests/semantics/test_random_graphs.py", "-k", "oracle_permits")
_FUSED: Final = ("tests/semantics/test_fused.py", "-k", "fused_interpreted_and_watched")
_DEATHS: Final = ("tests/parts/test_losses_at_random.py",)
_PLAYED: Final = ("tests/recording/test_playing.py", "-k", "recorded_on_the_real_clock")


class Mutant(NamedTuple):
    """A fault.

    Attributes:
      name: what is wrong with it, in a few words.
      rule: the rule that it breaks.
      file: in which it is planted.
      old: the text that it replaces; it occurs once.
      new: what it says instead.
      tests: where it is looked for: files of the suite whose graphs are small enough to be read, and which of them.
    """

    name: str
    rule: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]


def _fused(name: str, rule: str, file: str, old: str, new: str, tests: tuple[str, ...] = _RULES) -> Mutant:
    return Mutant(name, rule, f"hfg/engine/fusion/{file}.py", old, new, tests)


def _link(name: str, rule: str, file: str, old: str, new: str) -> Mutant:
    tests = _BOUNDED if file == "bounded" else _EXACT
    return Mutant(name, rule, f"hfg/links/{file}.py", old, new, tests)


MUTANTS: Final = (
    _fused(
        "in a region of more than 16 members two share the local of their outputs",
        "F3",
        "schedule",
        'return f"v{source}_{next(',
        'return f"v{source % 16}_{next(',
        _LARGE,
    ),
    _fused(
        "from the 17th member of a region on, branches are taken in the wrong order",
        "R2",
        "schedule",
        "stack.extend(reversed(enabled))",
        "stack.extend(reversed(enabled) if len(order) < 17 else enabled)",
        _LARGE,
    ),
    _fused(
        "a member whose inputs are all optional is called with nothing",
        "F4",
        "firing_text",
        'silences = [" and ".join(f"{self.schedule.local(edge)} is None" for edge in worker.live_inputs)]',
        "silences = []",
    ),
    _fused(
        "a silence at one of two mandatory inputs runs the function",
        "F4",
        "firing_text",
        'silence = " or ".join([*silences, *gates])',
        'silence = " or ".join([*([" and ".join(silences)] if silences else []), *gates])',
    ),
    _fused(
        "an absent optional input is None, whatever its default",
        "P6",
        "firing_text",
        'return value if edge.mandatory else f"(d{k}_{at} if {value} is None else {value})"',
        "return value",
        _SENDING,
    ),
    _fused(
        "an explicit modifier is lost",
        "A4",
        "binding",
        "if modifier is not None or stamp is not None or type(value) in _EXCEPTIONAL:",
        "if stamp is not None or type(value) in _EXCEPTIONAL:",
        _SENDING,
    ),
    _fused(
        "an explicit stamp is lost",
        "T5",
        "binding",
        "if modifier is not None or stamp is not None or type(value) in _EXCEPTIONAL:",
        "if modifier is not None or type(value) in _EXCEPTIONAL:",
    ),
    _fused(
        "a wave has the oldest stamp of what it took",
        "T5",
        "writing",
        'say(f"stamp = max(',
        'say(f"stamp = min(',
    ),
    _fused(
        "two outputs change places",
        "F3",
        "firing_text",
        'say(f"v{k}_{output} = values[{output}]")',
        'say(f"v{k}_{output} = values[{len(worker.out_names) - 1 - output}]")',
        _SENDING,
    ),
    _fused(
        "a marker calls a slot",
        "T4",
        "firing_text",
        'say(f"if {value} is not None:")\n        self.indent += 1\n        say(f"core.running_node',
        'say("if True:")\n        self.indent += 1\n        say(f"core.running_node',
        _SENDING,
    ),
    _fused(
        "activity that a token brings to the head is not received",
        "A6",
        "firing_text",
        'asked = " or ".join(f"{token}.activity" for token in tokens)',
        'asked = "False"',
        _FUSED,
    ),
    _fused(
        "whom a buffer has enabled does not go before the next wave",
        "R2",
        "writing",
        'stop += ["outputs.missing", "next_in_wave"]',
        'stop += ["outputs.missing"]',
    ),
    _fused(
        "slots do not get their tokens first",
        "F9",
        "schedule",
        'return sorted(edges, key=lambda one: one[0].target_kind != "slot")',
        "return edges",
    ),
    _fused(
        "members go breadth first",
        "R2",
        "schedule",
        "        stack.extend(reversed(enabled))\n",
        "        stack[:0] = reversed(enabled)\n",
    ),
    _fused(
        "of those who hear an output while they are active the first alone is sent what it sends",
        "T4",
        "binding",
        "for edge in listeners.who_hear():",
        "for edge in listeners.who_hear()[:1]:",
    ),
    _fused(
        "an active member that sends over an active edge is fused",
        "A5",
        "wave_state",
        "not any(one.active for one in self.activity_senders)",
        "True",
    ),
    _fused(
        "what a firing has sent is not waited for at a side exit",
        "F5",
        "wave_state",
        "edge.unprocessed = edge.live and (to >= k or not done[to]) and edge not in silent_calls",
        "edge.unprocessed = edge.live and to >= k and edge not in silent_calls",
        _FUSED,
    ),
    _fused(
        "what the head took is released though its outputs are not free",
        "F5",
        "region",
        "        if head.outputs.missing:\n            head.hold(self.held_entries)\n        elif self.held_entries:\n",
        "        if self.held_entries:\n",
        _FUSED,
    ),
    _fused(
        "silences behind a silence are not counted",
        "R7",
        "wave_state",
        "silent = self.silent[number] + spread",
        "silent = self.silent[number]",
    ),
    _fused(
        "finished waves are not counted at a side exit",
        "R7",
        "exits",
        '        self.waves += found["done"]\n',
        "",
        _MEDDLING,
    ),
    _fused(
        "an END that was promised before the head finds nobody",
        "F4",
        "region",
        "elif self.ending:  # an END",
        "elif False:  # an END",
        _LOOKING,
    ),
    _fused(
        "a flag that a call has raised is forgotten when it gives way",
        "F3",
        "giving_way",
        "self.called_off = bool(self.flags)",
        "self.called_off = False",
    ),
    _fused(
        "what async code sends by itself behind an await stays where it is",
        "F3",
        "giving_way",
        'self.amid = "wave"',
        'self.amid = "firing"',
        _SENDING,
    ),
    _fused(
        "those who stand behind a member do not follow at a side exit",
        "R2",
        "wave_state",
        "elif not worker.fireable and (agenda.make_fireable(worker) or worker.queued):",
        "elif False:",
    ),
    _fused(
        "a failing member's silence is laid as a value",
        "T2",
        "exits",
        "edge.token = Token(NO_MESSAGE if value is None else value, 0, stamp, edge.sent)",
        "edge.token = Token(value, 0, stamp, edge.sent)",
    ),
    _fused(
        "who looks inside of a wave is told the number before",
        "T5",
        "tap_writing",
        'self._say("nth = region.waves + done + 1")',
        'self._say("nth = region.waves + done")',
        _LOOKING,
    ),
    _fused(
        "who looks is not told what has passed before a side exit",
        "R7",
        "tap_writing",
        "self.untold[k] = list(self._waiting)",
        "self.untold[k] = []",
        _LOOKING,
    ),
    _fused(
        "the fast path of signals does not carry on activity that has left before",
        "A3",
        "slots",
        "if carries and (worker.active or worker.may_carry):",
        "if carries and worker.active:",
    ),
    _fused(
        "the fast path of signals keeps the activity that it gives",
        "A5",
        "slots",
        "        worker.give_away_activity()\n",
        "",
    ),
    _fused(
        "a node that waits has the oldest stamp of what it took",
        "T5",
        "waiting",
        "if token.stamp > stamp:",
        "if stamp < 0:",
    ),
    _fused(
        "a wave in a thread has the oldest stamp of what it took",
        "T5",
        "threads",
        "self.core.now() if head.is_source else max(",
        "self.core.now() if head.is_source else min(",
    ),
    _fused(
        "a wave in a thread releases what it took though its outputs are not free",
        "F5",
        "threads",
        "            head.drop_firing()\n            head.hold(self.held_entries)\n        elif",
        "            release(self.held_entries)\n        elif",
    ),
    _link(
        "a repeated run of tokens is accepted from its second on",
        "L2",
        "consumer",
        "known = self._accepted + 1 - frame.first",
        "known = max(self._accepted - frame.first, 0)",
    ),
    _link(
        "tokens behind a gap are accepted",
        "L2",
        "consumer",
        "        if known < 0:\n",
        "        if known < 0 and False:\n",
    ),
    _link(
        "a consumer holds one token too many",
        "L1",
        "consumer",
        "room = self.capacity - self._taken - len(self._waiting)",
        "room = self.capacity - self._taken - len(self._waiting) + 1",
    ),
    _link(
        "a ledger's consumer acknowledges what is not recorded",
        "L2",
        "consumer",
        "self.name, self.incarnation, self.epoch, self._stream, self._accepted, self._done, limit, self._seen",
        "self.name, self.incarnation, self.epoch, self._stream, self._accepted, self._accepted, limit, self._seen",
    ),
    _link(
        "what a dead producer had sent and nobody got is not counted",
        "L2",
        "consumer",
        "self.counts.abandoned += self._highest - self._accepted",
        "self.counts.abandoned += 0",
    ),
    _link(
        "what was taken of a former stream counts as done of the next",
        "L2",
        "consumer",
        "self._older = self.unfinished",
        "self._older = 0",
    ),
    _link(
        "a producer runs ahead by one more than its window",
        "P4",
        "producer",
        "min(self._released + self.window, before + self._most)",
        "min(self._released + self.window + 1, before + self._most + 1)",
    ),
    _link(
        "a producer forgets what one of its consumers has done",
        "L2",
        "producer",
        "done = released = min([peer.done for peer in peers], default=last)",
        "done = released = max([peer.done for peer in peers], default=last)",
    ),
    _link(
        "a new life of a consumer is sent nothing of what the former had accepted",
        "L2",
        "peer",
        "        self.incarnation = incarnation\n        self.fall_out()\n",
        "        self.incarnation = incarnation\n",
    ),
    _link(
        "a former life of a consumer is believed",
        "L2",
        "peer",
        "return incarnation >= self.incarnation and incarnation > 0",
        "return incarnation > 0",
    ),
    _link(
        "what was lost on the way is not sent again",
        "L2",
        "peer",
        "if status.seen >= self.last_serial and self.accepted < self.sent:",
        "if False:",
    ),
    _link(
        "a loss of one token is not counted",
        "L2",
        "bounded",
        "self.counts.lost += max(frame.first - self._last - 1, 0)",
        "self.counts.lost += max(frame.first - self._last - 2, 0)",
    ),
    _link(
        "the oldest is dropped where the newest is to be",
        "P5",
        "bounded",
        'if self._overflow == "drop_newest":',
        'if self._overflow == "newest":',
    ),
    Mutant(
        "an async member that sends after an await is not known to be the one whose call is under way",
        "F3",
        "hfg/engine/fusion/region.py",
        "return self.running and self.at_work(sys._getframe(1)) is worker",
        "return False and self.at_work(sys._getframe(1)) is worker",
        _FUSED,
    ),
    Mutant(
        "data overtakes start on its way to another process",
        "A10",
        "hfg/engine/runtime/borders.py",
        "if core.over or not core.started:",
        "if core.over:",
        _PARTS,
    ),
    Mutant(
        "an artificial deadlock is resolved only when nothing else is alive",
        "F8",
        "hfg/engine/runtime/engine.py",
        "        if core.suspects or core.all_suspect:\n            rings.resolve(core)\n",
        "",
        _GRAPHS,
    ),
    Mutant(
        "a value that raises when it is looked at escapes from the check of its type",
        "X1",
        "hfg/types.py",
        "        return fits(value)\n    except Exception:",
        "        return fits(value)\n    except KeyError:",
        _FUSED,
    ),
    Mutant(
        "nothing takes the place of what is lost with a process, so joins pair the wrong tokens",
        "L2",
        "hfg/parts/running/part.py",
        "return [((NO_MESSAGE, 0, stamp), (stream, number)) for number in numbers]",
        "return []",
        _DEATHS,
    ),
    Mutant(
        "a firing with two outputs that was recorded on the real clock is played as two",
        "F3",
        "hfg/recording/tracks.py",
        "if at_once and record.when != self.when:",
        "if record.when != self.when:",
        _PLAYED,
    ),
)
