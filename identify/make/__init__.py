"""Raw recordings made from the plant with every defect that was met, and their sealed truth."""
