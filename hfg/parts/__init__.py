"""A graph that is cut for processes, and run as one (rules L1 to L3, F7, R5).

agreement   when the whole is quiet, and what follows from that: decides, never waits
part        one part: an engine, and the tokens that leave it and come in
local       all parts on one event loop
"""
