"""Transports for links between processes: one module each, found through the entry-point group `hfg.transports`.

memory    within one process, with faults to order: for tests
zenoh     between processes and hosts, by Zenoh: pip install 'hfg[zenoh]'

Depends only on the lowest layers of hfg; hfg itself never imports it, so others can add transports as equals.
"""

__all__: list[str] = []
