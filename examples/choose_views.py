"""Choose the views of a recording that show the rest of it, by two policies.

The paper's rule takes a frame when more than a share of it is red. The default policy, `peaking`,
goes through the same frames and drops, of the views it holds, the one that is missed least; it
chooses as many views as the rule took.

Usage: python examples/choose_views.py scenes/desk 0.0428
"""

import sys

import peaking

recording = peaking.open_recording(sys.argv[1])
rule = peaking.SelectionOptions("threshold", threshold_share=float(sys.argv[2]))
taken = peaking.select(recording, selection=rule)
kept = peaking.select(recording, len(taken))
print(f"threshold: {' '.join(map(str, taken))}")
print(f"peaking:   {' '.join(map(str, kept))}")
