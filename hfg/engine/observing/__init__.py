"""Observers of a run: listeners, taps, statistics, reports.

consumers   of the trace        taps        at ports and edges
tables      how print shows them
measuring   statistics, kept by meters, shown as statistics, glance (cheap) and report (at the end)
"""

__all__: list[str] = []
