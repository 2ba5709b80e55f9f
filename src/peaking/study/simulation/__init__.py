"""Studies that nobody took part in, with effects that are known: for demos, tests and planning.

`truth` (what is true in the population), `draw` (participants' numbers), `folder` (a study's folder
as `peaking study serve` writes it), and `error_rates` (what the analysis does on many of them).
"""
