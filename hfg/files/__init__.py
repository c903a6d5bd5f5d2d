"""Graph files, `*.hfg.yaml`: graphs that people can read, diff and merge; no engine is needed for them.

    face          load and save
    building      a graph of a document        describing    a document of a graph
    reading       a document of a text         writing       a text of a document, into a file
    parsing       YAML with lines, in limits   emitting      YAML, one item per line
    json_schema   of graph files               typed         the same with node types
    boxes         subgraphs in files           missing       placeholders for missing types
    allowed       what may be imported         opening       files that may be too large
    findings      problems with their lines    apex          files of CS::APEX

Text, document and graph are three things: a reader of another format makes a document and continues from there.
Documents, and how graphs and documents become each other, belong to `hfg.graph.editing`.
"""

from hfg.files.face import build, describe, load, read, save, schema, text_of, write
from hfg.graph.editing.document import (
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
