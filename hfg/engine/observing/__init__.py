"""Who looks at a run: listeners, taps, statistics, reports."""

__all__: list[str] = []
