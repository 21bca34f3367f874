"""What people look at: page shell and plots (kit), the page of a run (run), 3-D pictures and films (render)."""
