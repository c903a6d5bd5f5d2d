"""A report page for a run: one file with the drawing, activity over time, counts, errors and pictures.

pages       the page of a run in progress, and its file    observing     data kept of a run, within bounds
html        the page as text                               pictures      pixels as PNG
sections    contents that users add to it             judged        monitors and deadlines
"""

from hfg.reporting.pages import ReportPage, report_page

__all__ = ["ReportPage", "report_page"]
