"""Transports for links between processes: one module each, found through the entry-point group `hfg.transports`.

memory    within one process, with faults to order: for tests
zenoh     between processes and hosts, by Zenoh: pip install 'hfg[zenoh]'

Stands on floors 0 and 1 of hfg alone; hfg itself never imports it, so others can add transports as equals.
"""

__all__: list[str] = []
