"""What the rules decide: firing, sending, releasing, activity, ending, being quiet. Plain functions that never wait."""

__all__: list[str] = []
