"""Many designs at once: parameters, sampling, batches, processes or a cluster, and their file."""
