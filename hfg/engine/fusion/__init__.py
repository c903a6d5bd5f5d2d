"""Fast paths: what the rules prescribe for the common shapes, as fewer steps."""

__all__: list[str] = []
