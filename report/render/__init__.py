"""Pictures of the machine from the plant's truth, drawn in plain numpy and numba: no display, no graphics driver."""

from report.render.pictures import Film, Picture, Pictures, arrow_key, pictures_of, render

__all__ = ["Film", "Picture", "Pictures", "arrow_key", "pictures_of", "render"]
