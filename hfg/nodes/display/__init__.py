"""Display: values for people, as text, images and plots, without a screen."""

from hfg.nodes.display.images import ImageDisplay, image_grid
from hfg.nodes.display.plots import HistogramPlot, ScatterPlot, TimePlot, VectorPlot
from hfg.nodes.display.show import Show
from hfg.nodes.display.text import Indicator, SignalLight, TextDisplay, format_table, log_value

__all__ = [
    "HistogramPlot",
    "ImageDisplay",
    "Indicator",
    "ScatterPlot",
    "Show",
    "SignalLight",
    "TextDisplay",
    "TimePlot",
    "VectorPlot",
    "format_table",
    "image_grid",
    "log_value",
]
