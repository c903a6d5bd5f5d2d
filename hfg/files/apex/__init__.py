"""Files of CS::APEX, `*.apex` and `*.apexs`, become graph files; a report says what became of each part.

face         read and load: the whole way
reading      what a file says                document   that, as structs
converting   a graph file's document of it   table      which type is what here, from types.yaml
ports        which port a number means       proving    what cannot be built is taken out, and told
report       what became of each part
"""

from hfg.files.apex.face import load, read
from hfg.files.apex.report import ConversionReport, Converted

__all__ = ["ConversionReport", "Converted", "load", "read"]
