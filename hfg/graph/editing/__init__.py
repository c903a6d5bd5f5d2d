"""Edits of a graph as data, carried out exactly and taken back exactly (rule R4).

commands    what is to change            performing    carries commands out: replacing, copying, enclosing
steps       edits of objects in a graph  changes       what they did, to be taken back exactly
document    a graph as data              to_document   makes it of a graph      from_document  makes a graph of it
boxes       types of subgraphs as data   to_commands   a graph as the commands that build it
transactions  all or nothing, undo, redo, reloading of modules                  type_texts     types of ports as strings
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
