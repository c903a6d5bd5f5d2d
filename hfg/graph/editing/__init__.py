"""Edits of a graph as data, carried out exactly and taken back exactly (rule R4).

commands    what is to change            performing  what carries it out: making, copying, enclosing
changes     its steps, to be taken back  transactions  all or nothing, undo and redo       reloading  of modules
telling     a graph as the commands that make it     type_texts    types of ports as text
"""

from hfg.graph.editing.transactions import (
    Transaction,
    edit,
    history_of,
    may_break,
    prepare,
    redo,
    refuse_new_errors,
    reload,
    undo,
)

__all__ = [
    "Transaction",
    "edit",
    "history_of",
    "may_break",
    "prepare",
    "redo",
    "refuse_new_errors",
    "reload",
    "undo",
]
