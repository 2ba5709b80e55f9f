"""From a study's folder to tables, figures and a report, in the order of the files' names below.

`matrix` (one measure as participants × conditions), `analyse` (tests, families, order, power),
`words` (numbers and sentences as APA has them), `csv_files`, `box_plots`, `forest`,
`likert`, `over_time`, `report`, and `run`, which writes them all.
"""
