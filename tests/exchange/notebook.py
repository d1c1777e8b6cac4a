"""Runs the code of a notebook, cell after cell, as Jupyter would. Arguments: the notebook, a site's products."""

import json
import os
import sys

notebook, site = sys.argv[1:]
os.environ["AREOGRAPH_SITE"] = site
os.environ["MPLBACKEND"] = "Agg"
with open(notebook, encoding="utf-8") as file:
    cells = json.load(file)["cells"]
names = {}
for number, cell in enumerate(cells, 1):
    if cell["cell_type"] == "code":
        assert not cell["outputs"], f"cell {number} is kept with its output"
        exec(compile("".join(cell["source"]), f"cell {number}", "exec"), names)
import matplotlib.pyplot as plt

print("figures:", len(plt.get_fignums()))
