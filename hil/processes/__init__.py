"""What each process of the bench does; one module each, so that a process loads only what it needs."""
