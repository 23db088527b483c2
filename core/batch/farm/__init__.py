"""A batch on many machines: in shards that are joined, or on the workers of a Dask cluster."""
