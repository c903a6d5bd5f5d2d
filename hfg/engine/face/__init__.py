"""What users hold in their hands: a run, its feeds and readers."""

__all__: list[str] = []
