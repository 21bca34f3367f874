"""The report of a diagnosis: one self-contained HTML page of the same family as the bench report."""

from diagnosis.page.page import page

__all__ = ["page"]
