"""Opens a QGIS project as QGIS does, draws its map, and prints the layers and the colours of the map as JSON.

Usage: qgis_project.py PROJECT PICTURE
"""

import json
import os
import sys
from collections import Counter

os.environ["QT_QPA_PLATFORM"] = "offscreen"

from qgis.core import QgsApplication, QgsMapRendererSequentialJob, QgsMapSettings, QgsProject  # noqa: E402
from qgis.PyQt.QtCore import QSize  # noqa: E402
from qgis.PyQt.QtGui import QColor  # noqa: E402

application = QgsApplication([], False)
application.initQgis()
project = QgsProject.instance()
is_read = project.read(sys.argv[1])
tree = project.layerTreeRoot()
layers = tree.layerOrder()
settings = QgsMapSettings()
settings.setLayers([layer for layer in layers if tree.findLayer(layer.id()).isVisible()])
settings.setDestinationCrs(project.crs())
settings.setExtent(project.viewSettings().defaultViewExtent())
settings.setOutputSize(QSize(700, 1400))
settings.setBackgroundColor(QColor("white"))
job = QgsMapRendererSequentialJob(settings)
job.start()
job.waitForFinished()
image = job.renderedImage()
image.save(sys.argv[2])
colours = Counter(
    image.pixelColor(column, row).name() for row in range(image.height()) for column in range(image.width())
)
print(json.dumps({
    "read": is_read,
    "crs": project.crs().toProj(),
    "errors": [error.message for error in job.errors()],
    "layers": [{
        "name": layer.name(),
        "valid": layer.isValid(),
        "crs": layer.crs().toProj(),
        "shown": tree.findLayer(layer.id()).isVisible(),
        "renderer": layer.renderer().type(),
        "features": layer.featureCount() if hasattr(layer, "featureCount") else None,
    } for layer in layers],
    "colours": dict(colours.most_common(200)),
}))
sys.stdout.flush()
# QGIS may crash while Python takes it apart.
os._exit(0)
