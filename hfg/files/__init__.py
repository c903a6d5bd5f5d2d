"""Graph files, `*.hfg.yaml`: graphs that people can read, diff and merge; no engine is needed for them.

    face          load and save: the whole way
    building      a graph of a document        describing    a document of a graph
    reading       a document of a text         writing       a text of a document, into a file
    parsing       YAML with lines, in limits   emitting      YAML, one thing a line
    document      what a file says, as structs schema        the same as a JSON schema; typed: with node types
    boxes         types of subgraphs           missing       stands in for types that are not there
    allowed       what may be imported         values        parameters as plain data
    findings      what is wrong, where              apex           files of CS::APEX

Text, document and graph are three things: what reads another format makes a document and goes on from there.
"""

from hfg.files.document import (
    VERSION,
    BoxDocument,
    Document,
    EdgeDocument,
    GateDocument,
    GroupDocument,
    InsideDocument,
    NodeDocument,
    OperatorDocument,
    ParameterDocument,
)
from hfg.files.face import build, describe, load, read, save, schema, text_of, write

__all__ = [
    "VERSION",
    "BoxDocument",
    "Document",
    "EdgeDocument",
    "GateDocument",
    "GroupDocument",
    "InsideDocument",
    "NodeDocument",
    "OperatorDocument",
    "ParameterDocument",
    "build",
    "describe",
    "load",
    "read",
    "save",
    "schema",
    "text_of",
    "write",
]
