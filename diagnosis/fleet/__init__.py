"""Many arms of the same work on dask.distributed: each result kept as it comes, so that nothing is lost and nothing done twice."""
