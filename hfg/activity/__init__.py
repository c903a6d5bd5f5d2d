"""The rules of activity, pure (rules A3-A6)."""

from hfg.activity.rules import after_receipt, leaving

__all__ = ["after_receipt", "leaving"]
