"""The rows of the task on an NVIDIA GPU (extra ``cuda``): the engine's own scalar functions, one thread a row.

Nothing here is imported unless a CUDA device is asked for. ``NUMBA_ENABLE_CUDASIM=1 NUMBA_DISABLE_JIT=1`` runs it all as
plain Python in numba's simulator, which needs no GPU and shows that indices and launches are right; it is no place to
train.
"""
