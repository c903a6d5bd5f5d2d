"""Values as data: plain data for files and people, bytes between processes.

    data         any value as YAML and JSON hold it, and back by its declared type; used by parameters and files
    decoding     the way back, and references to code
    codecs       how the values of a type are composed, compiled once per type
    carriers     what a codec consists of
    standard     how classes of the standard library are carried
    records      classes with fields
    arrays       which arrays travel as raw bytes
    descriptions what two ends compare before the first value
    plain        JSON from an unknown source, within bounds
    wire         tokens as bytes and back

To store a value in a file, use `encode` and `decode`; to send tokens, use `TokenCodec`.
"""

from hfg.encoding.arrays import ArrayHead, Lease
from hfg.encoding.codecs import codec_for, wire_problem
from hfg.encoding.data import decode, encode, has_tag, read_text
from hfg.encoding.decoding import TAG, Find, find_reference, is_data_type, reference_to
from hfg.encoding.descriptions import description_of, difference, type_fingerprint
from hfg.encoding.wire import Limits, TokenCodec

__all__ = [
    "TAG",
    "ArrayHead",
    "Find",
    "Lease",
    "Limits",
    "TokenCodec",
    "codec_for",
    "decode",
    "description_of",
    "difference",
    "encode",
    "find_reference",
    "has_tag",
    "is_data_type",
    "read_text",
    "reference_to",
    "type_fingerprint",
    "wire_problem",
]
