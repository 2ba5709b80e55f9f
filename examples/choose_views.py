"""Choose the views of a recording that show the rest of it best, and write them as a data set.

python examples/choose_views.py scenes/desk 8 out/chosen
"""

import sys
from pathlib import Path

import peaking

recording = peaking.open_recording(sys.argv[1])
chosen = peaking.select(recording, num_views=int(sys.argv[2]))
recording.write_subset(chosen, Path(sys.argv[3]))
print(f"{len(chosen)} of {len(recording)} frames: {' '.join(map(str, chosen))}")
