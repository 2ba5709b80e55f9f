"""The statistics of a user study, from numbers to an outcome with its decision path.

Read in this order: `outcome` (what a test gives), `assumptions` (what is asked before), `paired`
and `groups` (the tests of two conditions), `several` (of three and more), `decision` (which of
them, as the paper decides), `holm` (families), `order_effects` and `power`. Nothing here knows what
was measured or reads a file.

Every statistic, p-value, effect size and interval is compared with R's in `tests/oracles/`.
"""
