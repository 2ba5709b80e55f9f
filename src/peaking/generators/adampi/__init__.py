"""AdaMPI (Han et al., SIGGRAPH 2022), a learned generator: needs `torch` and a checkpoint.

`network.py` is the method; `cpu.py` and `chunked.py` do the same faster and with less memory;
`generator.py` is what the rest of the program calls. Nothing is imported unless it is asked for.
"""
