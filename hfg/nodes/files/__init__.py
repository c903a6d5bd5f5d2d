"""Files: read whole, as streams, and written; standard input and output.

Nodes that reach files do so where they run: on the loop they hold it up meanwhile. For files of everyday size that is
microseconds; pictures, slow disks and the network are for a thread group, `graph.group("files")`.
"""

from hfg.nodes.files.reading import (
    list_directory,
    read_array,
    read_arrays,
    read_bytes,
    read_csv,
    read_image,
    read_json,
    read_raw_image,
    read_text,
)
from hfg.nodes.files.sinks import (
    StackArrays,
    StandardOutput,
    WriteArray,
    WriteArrays,
    WriteBytes,
    WriteCsv,
    WriteImage,
    WriteJson,
    WriteJsonLines,
    WriteLines,
    WriteText,
)
from hfg.nodes.files.sources import ArrayRows, CsvRows, FilePaths, ImageFiles, JsonLines, StandardInput, TextLines

__all__ = [
    "ArrayRows",
    "CsvRows",
    "FilePaths",
    "ImageFiles",
    "JsonLines",
    "StackArrays",
    "StandardInput",
    "StandardOutput",
    "TextLines",
    "WriteArray",
    "WriteArrays",
    "WriteBytes",
    "WriteCsv",
    "WriteImage",
    "WriteJson",
    "WriteJsonLines",
    "WriteLines",
    "WriteText",
    "list_directory",
    "read_array",
    "read_arrays",
    "read_bytes",
    "read_csv",
    "read_image",
    "read_json",
    "read_raw_image",
    "read_text",
]
