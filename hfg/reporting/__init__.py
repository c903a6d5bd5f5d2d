"""A run as a page to look at: one file with the drawing, who was active when, counts, errors and pictures.

pages       the page of a run under way, and its file     observing     what is kept of a run, within bounds
html        the page as text                              pictures      pixels as PNG
sections    what users add to it
"""

from hfg.reporting.pages import ReportPage, report_page

__all__ = ["ReportPage", "report_page"]
